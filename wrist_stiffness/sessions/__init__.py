"""A measuring campaign on one wrist: from recordings to units with their conditions."""
