"""Codecs of ATI electronics: pure functions between bytes and samples."""
