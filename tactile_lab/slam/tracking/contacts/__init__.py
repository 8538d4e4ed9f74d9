"""Contacts, poses and motion as the trackers see them."""
