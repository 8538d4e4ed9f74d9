"""Evaluation of sessions: ground truth from the marker camera, error metrics, result files, sweeps and timings."""
