"""A session on disk: its folder, manifest, events, clock and recorder."""
