"""The catalogue: one file per law, found by `model.registry`."""
