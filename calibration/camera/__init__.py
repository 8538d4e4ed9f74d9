"""The lens."""
