"""A running session as a node of ROS 2: topics out, services in."""
