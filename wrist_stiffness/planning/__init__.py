"""Plan the experiment that tells what the last one could not."""
