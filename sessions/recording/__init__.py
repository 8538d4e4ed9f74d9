"""A session on the disk: its folder, manifest, events, clock and recorder."""
