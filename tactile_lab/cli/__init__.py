"""The command line: the only place that prints. Heavy imports happen inside the commands."""
