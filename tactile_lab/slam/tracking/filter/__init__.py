"""The thesis's particle filter, with its gate and with a calibrated likelihood."""
