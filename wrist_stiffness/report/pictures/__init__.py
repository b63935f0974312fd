"""Pictures; matplotlib is imported where it draws."""
