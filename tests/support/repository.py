"""The path of the repository and of its packaged rigs, independent of a test's location."""

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
SIMULATED_HAND = REPOSITORY / "tactile_lab" / "rigs" / "calibrations" / "simulated-hand"
LOGS = REPOSITORY / "tests" / "logs"
