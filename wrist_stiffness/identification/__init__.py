"""Find the effects that are missing in a model of this wrist."""
