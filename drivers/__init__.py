"""Devices of the laboratory: links move bytes, codecs turn them into samples, devices own the lifecycle."""
