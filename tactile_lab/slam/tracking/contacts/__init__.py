"""Contacts, poses and motion for the trackers."""
