"""What every package speaks in: errors, time, poses, contacts, configuration, transports, child processes."""
