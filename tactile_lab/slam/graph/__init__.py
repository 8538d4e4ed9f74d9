"""The pose graph behind the filter (thesis section 3.3.3)."""
