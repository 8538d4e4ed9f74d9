"""Results of calibrations as sealed files, and whether a session may use them."""
