"""All wire faults in the middle of a session, as a table.

python -m tests.support.session_fault_table --store
python -m tests.support.session_fault_table --store --missing
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.support.session_sweep import (
    BLIND,
    LAYOUTS,
    LONGEST_s,
    Swept,
    UNTIL_IT_MOVES_s,
    faults,
    run_with,
)
from tests.support.stored_table import GrowingTable, Key, Outline, parser

TIMES = ", ".join(
    [f"{transport} {most:g} s" for transport, most in LONGEST_s.items()]
    + [f"{transport}, {fault} {most:g} s" for (transport, fault), most in UNTIL_IT_MOVES_s.items()]
)
OUTLINE = Outline(
    "session-faults",
    "Every fault of every link in the middle of a session.",
    ("python -m tests.support.session_fault_table --store",),
    "A session of one grasp on the box, seed 1; faults begin when the fingers first close; the first picture comes "
    f"later. A session ends in order within the time stated ({TIMES}), or goes on. In both cases "
    "its recording was then read without loss and replayed: results identical byte for byte, where the session came "
    "to any. Told: what its events and its record say, with the figures at the end.",
    ("Rig", "Link", "Fault", "Struck", "The session", "Told and stored", "Replay"),
    keys=3,
)


def cells(rig: str, transport: str, fault: str, swept: Swept) -> tuple[str, ...]:
    """One line of the table, without its transport and fault."""
    went = f"ends after {swept.after_s:.2f} s: {swept.ended}" if swept.ended else "goes on"
    unseen = "as it ended" if swept.ended else BLIND[rig][transport].get(fault, "harmless")
    told = "; ".join(swept.told) or unseen
    return str(swept.struck), went, told, swept.replay


def run(table: GrowingTable, keys: Sequence[Key]) -> None:
    """Run sessions. Raises AssertionError if one hangs, or if its recording cannot be read."""
    for rig, transport, fault in keys:
        with tempfile.TemporaryDirectory() as root:
            swept = run_with(rig, {transport: fault}, Path(root))
        swept.check(transport, fault)
        table.put((rig, transport, fault), cells(rig, transport, fault, swept))


def main() -> None:
    """Print the table, and store it row by row if requested."""
    options = parser(__doc__)
    options.add_argument("--rigs", default=",".join(LAYOUTS))
    options.add_argument("--only", default="", help="Part of the link's or the fault's name.")
    options.add_argument("--missing", action="store_true", help="Only what this version has not made.")
    chosen = options.parse_args()
    table = GrowingTable(chosen.docs, OUTLINE, [(rig, *fault) for rig in LAYOUTS for fault in faults(rig)])
    asked = [(rig, *fault) for rig in chosen.rigs.split(",") for fault in faults(rig) if chosen.only in " ".join(fault)]
    run(table, [key for key in asked if not chosen.missing or key in table.missing])
    table.publish()


if __name__ == "__main__":
    main()
