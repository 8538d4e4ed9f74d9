"""A rig as the place where calibrations are measured."""
