"""Calibration results as sealed files, and their admission to sessions."""
