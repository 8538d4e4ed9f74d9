"""The hand as a device: cycle, control, limits and health."""
