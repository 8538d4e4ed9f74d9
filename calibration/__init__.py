"""Calibration: what ties the sensors to the world, in files a rig names."""
