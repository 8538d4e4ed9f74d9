"""The experiments by topic; :mod:`tactile_lab.experiments.catalogue` has them all by name."""
