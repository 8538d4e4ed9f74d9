"""Far ends of real wires: devices that independent masters and clients take for the real ones."""
