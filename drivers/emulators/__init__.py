"""Emulators at the far end of real wires: independent masters and clients cannot distinguish them from real devices."""
