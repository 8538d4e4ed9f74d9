"""Tactile SLAM, pure science: no device, no session, no file."""
