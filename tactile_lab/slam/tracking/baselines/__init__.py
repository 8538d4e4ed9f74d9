"""Baseline trackers: odometry and registration."""
