"""A running session over Foxglove's WebSocket protocol, from a process of its own."""
