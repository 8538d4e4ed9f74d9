"""The simulated rig: one physics simulation behind the bytes of all devices."""
