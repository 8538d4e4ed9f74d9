"""Tactile SLAM itself: independent of devices, sessions and files."""
