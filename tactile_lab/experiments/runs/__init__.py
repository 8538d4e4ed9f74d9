"""The runs of each experiment, from a cell to its figures."""
