"""ROS 2 nodes: thin shells that convert a message in, call the core and convert the answer out."""
