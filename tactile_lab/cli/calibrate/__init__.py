"""``tactile-lab calibrate``."""
