"""Shared parts of all calibrations: guided steps, motion checks, refinement, verdicts."""
