"""What all calibrations share: guided steps, motion checks, refinement, verdicts."""
