"""The jobs of the command line, free of printing: run a session, judge it, replay it, sweep over many."""
