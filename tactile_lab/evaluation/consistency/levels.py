"""The stated probabilities at which uncertainties are judged."""

from __future__ import annotations

LEVELS = (0.50, 0.68, 0.95)
"""The stated probabilities that are compared with the share of true values inside."""
CURVE = (0.10, 0.20, 0.30, 0.40, 0.50, 0.60, 0.68, 0.80, 0.90, 0.95, 0.99)
"""Those of a calibration curve."""
