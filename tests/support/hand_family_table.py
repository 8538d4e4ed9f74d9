"""A family of 121 hands as the published configurations have them, on the emulated ring, as a table.

python -m tests.support.hand_family_table --store
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from pathlib import Path

from drivers.core.errors import TactileLabError
from tests.support.emulated_hands import EmulatedBench, setup_of
from tests.support.hand_family import FamilyHand, family, write_hand
from tests.support.stored_table import GrowingTable, Outline, parser

OUTLINE = Outline(
    "hand-family",
    "Hands of every published kind: loaded and moved motor by motor, or refused with the defect of the file.",
    ("python -m tests.support.hand_family_table --store",),
    "121 hands in the published proportions of sides, fingers and defects, with the published motor maps; palms, "
    "tables, signs and defects drawn by seeds 1 to 121. Each folder is checked as by `rig check --move`, on the "
    "emulated ring in one process and virtual time: the files, the palm, all of its motors, and whether each moves its "
    "own joint.",
    ("Kind", "Defect of the file", "Hands", "Moved", "Refused", "Told, for example"),
    keys=2,
)


def outcome(hand: FamilyHand, root: Path) -> str:
    """Why a hand is refused or does not move as its map says; "" if every motor moves its own joint."""
    try:
        findings = EmulatedBench(setup_of(write_hand(root, hand)), hand.serial).moves()
    except TactileLabError as error:
        return str(error).replace(str(root), "")
    return "; ".join(str(finding) for finding in findings if not finding.ok)


def main() -> None:
    """Print the table, and store it row by row if requested."""
    chosen = parser(__doc__).parse_args()
    groups = defaultdict[tuple[str, str], list[FamilyHand]](list)
    for hand in family():
        groups[hand.group, hand.defect].append(hand)
    table = GrowingTable(chosen.docs, OUTLINE, list(groups))
    for (group, defect), hands in groups.items():
        with tempfile.TemporaryDirectory() as root:
            refused = [words for words in (outcome(hand, Path(root)) for hand in hands) if words]
        counts = (str(len(hands)), str(len(hands) - len(refused)), str(len(refused)))
        table.put((group, defect), (*counts, refused[0] if refused else ""))
    table.publish()


if __name__ == "__main__":
    main()
