"""Codecs of ATI electronics: pure functions that convert between bytes and samples."""
