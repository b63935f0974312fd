"""The whole wrist as one finite-element model: the judge of what is condensed part by part."""
