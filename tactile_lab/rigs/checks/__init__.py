"""Is a rig fit to work? Nothing moves."""
