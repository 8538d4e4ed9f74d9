"""Far ends of the simulated rig's transports: true quantities in, device bytes out."""
