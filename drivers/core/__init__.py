"""Shared types of all packages: errors, time, poses, contacts, configuration, transports, child processes."""
