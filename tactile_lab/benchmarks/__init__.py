"""Benchmarks of speed and memory, compared with the obvious alternatives."""
