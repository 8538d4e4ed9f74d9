"""Emulators at the far end of real wires: independent masters and clients cannot tell them from real devices."""
