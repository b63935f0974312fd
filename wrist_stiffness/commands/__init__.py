"""One function per command: it calls the rooms in order and returns data, printing nothing."""
