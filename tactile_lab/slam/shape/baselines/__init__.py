"""Shape models for comparison (thesis section 2.1)."""
