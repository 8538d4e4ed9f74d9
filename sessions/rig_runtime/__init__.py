"""The connected devices of a rig, run in one common cycle."""
