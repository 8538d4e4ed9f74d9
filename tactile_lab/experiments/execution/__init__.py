"""Where the cells of an experiment are run: in this process, in others, or on a cluster."""
