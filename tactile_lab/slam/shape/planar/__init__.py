"""Outlines with straight faces."""
