"""A measuring campaign on one wrist: from recordings to what the statistics of `diagnosis` need.

This room knows the wrist, its model and its recordings; `diagnosis` knows none of them.
"""
