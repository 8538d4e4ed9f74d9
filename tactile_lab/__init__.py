"""Tactile SLAM in the laboratory: shape and pose of an unknown object from a few fingertip contacts."""
