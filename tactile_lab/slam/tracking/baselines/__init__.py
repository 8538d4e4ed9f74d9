"""Trackers to compare with: odometry and registration."""
