"""Shape models to compare with (thesis section 2.1)."""
