"""The object's shape from contacts at known poses (thesis chapter 2)."""
