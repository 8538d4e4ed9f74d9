"""ATI Nano17 force sensors: protocols, and the wires on which their readings arrive."""
