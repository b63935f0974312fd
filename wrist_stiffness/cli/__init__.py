"""The command line: a thin shell that reads arguments, calls one workflow and prints its result."""
