"""Where the repository lies, and its shipped rigs in it, wherever a test stands."""

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
SIMULATED_HAND = REPOSITORY / "tactile_lab" / "rigs" / "calibrations" / "simulated-hand"
LOGS = REPOSITORY / "tests" / "logs"
