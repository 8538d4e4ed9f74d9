"""The jobs of the command line, without printing: run, evaluate, replay and sweep sessions."""
