"""Pictures: every function writes one PNG; matplotlib is imported where it draws."""
