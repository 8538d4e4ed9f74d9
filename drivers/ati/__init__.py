"""ATI Nano17 force sensors: their protocols, and the wires that carry their readings."""
