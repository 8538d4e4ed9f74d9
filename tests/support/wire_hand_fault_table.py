"""Faults in the middle of sessions on real wires, as a table: sim-wire for the hand, sim-ur for the arm; in real time.

python -m tests.support.wire_hand_fault_table --store
python -m tests.support.wire_hand_fault_table --store --missing
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

from tactile_lab.rigs.description import load_rig
from tactile_lab.rigs.laboratory import WiredLaboratory, open_laboratory
from tests.support.stored_table import GrowingTable, Outline, parser
from tests.support.wire_hand_faults import ARM_FAULTS, HAND_FAULTS, WireFault, WireOutcome, run_fault
from tests.support.wire_rig import wire_rig

FAULTS: Mapping[str, Mapping[str, WireFault]] = {"sim-wire": HAND_FAULTS, "sim-ur": ARM_FAULTS}

OUTLINE = Outline(
    "wire-hand-faults",
    "Faults of hand and arm in the middle of sessions over real wires.",
    ("python -m tests.support.wire_hand_fault_table --store",),
    "Sessions of one grasp of the box in real time, the hand's cycle 4 ms, the session's 10 ms, each emulator in a "
    "process of its own; from the recordings. A fault begins when the fingers first close, FFJ3 in the middle of its "
    "way. Seen: from then until the first status of the hand, or of the arm, that shows it (the frozen sensor: until "
    "its joint is driven; where statuses end, until the last one). Last demand: from then, or from the beginning where "
    "no status shows it, until the last demand above zero, the time of the fault's rule (docs/failures.md) included. "
    "Late cycles: those of the hand with such a demand after the rule's time.",
    ("Rig", "Fault", "Seen", "Rule", "Last demand", "Late cycles", "The session"),
    keys=2,
)


def cells(fault: WireFault, found: WireOutcome) -> tuple[str, ...]:
    """One line of the table, without rig and fault."""
    seen = "" if found.seen_s is None else f"{1000 * found.seen_s:.0f} ms"
    rule = f"{1000 * fault.rule_s:.0f} ms" if fault.rule_s else ""
    if not found.reason:
        return seen, rule, "", "", "goes on"
    return seen, rule, f"{1000 * found.driven_s:.0f} ms", str(found.late_cycles), f"ends: {found.reason}"


def main() -> None:
    """Print the table, and store it row by row if requested."""
    options = parser(__doc__)
    options.add_argument("--missing", action="store_true", help="Only what this version has not made.")
    options.add_argument("--only", default="", help="Part of the rig's or the fault's name.")
    chosen = options.parse_args()
    table = GrowingTable(chosen.docs, OUTLINE, [(rig, name) for rig, faults in FAULTS.items() for name in faults])
    for shipped, faults in FAULTS.items():
        names = [name for name in faults if chosen.only in f"{shipped} {name}"]
        run(table, shipped, [name for name in names if not chosen.missing or (shipped, name) in table.missing])
    table.publish()


def run(table: GrowingTable, shipped: str, names: list[str]) -> None:
    """Run a rig's faults in one laboratory."""
    if not names:
        return
    with tempfile.TemporaryDirectory() as root:
        rig = load_rig(str(wire_rig(Path(root), shipped)))
        with open_laboratory(rig, 0, "box-10x6x4") as laboratory:
            assert isinstance(laboratory, WiredLaboratory)
            for name in names:
                fault = FAULTS[shipped][name]
                found = run_fault(fault, rig, laboratory, Path(root) / name.replace(" ", "-"))
                table.put((shipped, name), cells(fault, found))


if __name__ == "__main__":
    main()
