"""Rigs: YAML files that name devices, their calibration and their limits, and the code that builds them."""
