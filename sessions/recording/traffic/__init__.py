"""The traffic file: raw bytes and samples in MCAP, written and read."""
