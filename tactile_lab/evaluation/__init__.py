"""How good a session was: truth from the marker camera, error figures, result files, sweeps and timings."""
