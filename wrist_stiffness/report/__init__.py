"""Reports for people: one HTML file each, without any other file and without a network."""
