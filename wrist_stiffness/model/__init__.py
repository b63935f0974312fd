"""The error model: a table and the effects that were added to it."""
