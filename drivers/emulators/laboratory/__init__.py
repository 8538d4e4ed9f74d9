"""Emulators on real wires that share one simulated plant. Each has its own process, so that any can fail alone."""
