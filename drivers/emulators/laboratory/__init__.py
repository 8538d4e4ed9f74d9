"""Emulators on real wires that share one simulated plant: a process each, so that any of them can fail alone."""
