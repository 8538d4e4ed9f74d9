"""Outlines of straight faces."""
