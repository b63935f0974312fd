"""From a sample to a prediction or a corrected command: the one path of nodes and replay."""
