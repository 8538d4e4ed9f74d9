"""The wires on which the readings of a Nano17 reach the computer."""
