"""Calibration: relations between sensors and the world, in files named by a rig."""
