"""All faults of the hand itself in the middle of a session, as a table.

python -m tests.support.session_hand_fault_table --store
python -m tests.support.session_hand_fault_table --store --missing
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

from tests.support.session_hand_faults import FAULTS, CYCLE_s, SessionHandFault, SessionHandOutcome, run_fault
from tests.support.stored_table import GrowingTable, Outline, parser

OUTLINE = Outline(
    "session-hand-faults",
    "Every fault of the hand itself in the middle of a session.",
    ("python -m tests.support.session_hand_fault_table --store",),
    f"A session of one grasp on the simulated rig, the box, seed 1, virtual time, cycles of {1000 * CYCLE_s:g} ms. "
    "Faults of FFJ3, of the motors or of the link from when the fingers first close. Seen "
    "after: the time that the fault's rule waits (docs/failures.md) and until the polling comes to it. Last demand: "
    "from the fault until the last demand above zero; for the frozen sensor from when its joint is driven, which "
    "is seconds later. Last joint turned: by more than 0.02 rad/s.",
    ("Fault", "Seen after, at most", "Last demand", "Last joint turned", "The session"),
)


def cells(fault: SessionHandFault, found: SessionHandOutcome) -> tuple[str, ...]:
    """One line of the table, without its fault."""
    seen = f"{1000 * fault.rule_s:.0f} ms"
    if found.driven_s is None or found.turned_s is None:
        return seen, "", "", f"is not ended by it; ends: {found.ended}" if found.ended else "goes on"
    cycles = max(0, math.ceil((found.driven_s - fault.rule_s) / CYCLE_s - 1e-6))
    later = f" ({cycles} cycles later)" if cycles else ""
    return seen, f"{1000 * found.driven_s:.0f} ms{later}", f"{1000 * found.turned_s:.0f} ms", f"ends: {found.ended}"


def main() -> None:
    """Print the table, and store it row by row if requested."""
    options = parser(__doc__)
    options.add_argument("--missing", action="store_true", help="Only what this version has not made.")
    chosen = options.parse_args()
    table = GrowingTable(chosen.docs, OUTLINE, [(name,) for name in FAULTS])
    for name, fault in FAULTS.items():
        if not chosen.missing or (name,) in table.missing:
            with tempfile.TemporaryDirectory() as root:
                table.put((name,), cells(fault, run_fault(fault, Path(root))))
    table.publish()


if __name__ == "__main__":
    main()
