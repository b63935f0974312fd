"""The catalogue: laws of one kind in one file, found by `model.registry`."""
