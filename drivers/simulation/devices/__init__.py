"""Simulated devices at the far ends of the rig's transports: true quantities in, device bytes out."""
