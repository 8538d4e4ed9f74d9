"""Hand-eye calibration from pairs of poses with prints of another size than stated: is the region honest?

python -m tests.support.print_scale_table [--store]
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gtsam import Pose3, Rot3

from calibration.forearm.pair_problem import PairProblem
from calibration.steps.observations import PosePair
from calibration.steps.quality import region_holds
from tests.support.stored_table import GrowingTable, Outline, parser

HAND_T_TARGET = Pose3.Expmap(np.array([0.3, -0.2, 0.5, 0.02, 0.05, -0.03]))
MOUNT_T_CAMERA = Pose3.Expmap(np.array([-1.0, 0.4, 0.2, 0.6, -0.2, 0.8]))
PAIRS, NOISE = 20, np.repeat([1e-3, 5e-4], 3)
LARGER = (0.0, 0.002, 0.005, 0.02)
SEEDS = range(1000, 1100)
OUTLINE = Outline(
    "print-scale",
    "Hand-eye calibration from pairs of poses of another program, with a print that is larger than stated.",
    ("python -m tests.support.print_scale_table --store",),
    f"{PAIRS} pairs with noise of 0.5 mm and 1 mrad; the same {len(SEEDS)} seeds for each print. The size of the print "
    "is an unknown of the calibration. The region is that of the camera's pose, six degrees of freedom.",
    ("Print larger by, %", "Truth inside the stated 95 % region", "Camera off, mm: median", "At most, mm"),
)


def simulated_pairs(seed: int, larger: float) -> tuple[PosePair, ...]:
    """Pairs as another program tells them that took the print to be smaller than it is by this share."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(PAIRS):
        hand = Pose3(Rot3.Expmap(0.6 * rng.standard_normal(3)), rng.uniform(-0.2, 0.2, 3))
        target = MOUNT_T_CAMERA.inverse() * hand * HAND_T_TARGET * Pose3.Expmap(NOISE * rng.standard_normal(6))
        made.append(PosePair(hand, Pose3(target.rotation(), target.translation() / (1.0 + larger))))
    return tuple(made)


def errors_mm(larger: float, seeds: Sequence[int]) -> tuple[int, list[float]]:
    """How often the 95 % region held the truth, and the errors of the camera's place."""
    held, errors = 0, []
    for seed in seeds:
        solution = PairProblem(simulated_pairs(seed, larger)).solve()
        held += region_holds(solution, MOUNT_T_CAMERA.inverse())
        off = solution.world_T_mount.inverse().translation() - MOUNT_T_CAMERA.translation()
        errors.append(1e3 * float(np.linalg.norm(off)))
    return held, errors


def main() -> None:
    """Make the table."""
    docs: Path | None = parser(__doc__).parse_args().docs
    table = GrowingTable(docs, OUTLINE, [(_percent(larger),) for larger in LARGER])
    for larger in LARGER:
        held, errors = errors_mm(larger, SEEDS)
        table.put((_percent(larger),), (f"{held} of {len(SEEDS)}", f"{np.median(errors):.2f}", f"{max(errors):.2f}"))
    table.publish()


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


if __name__ == "__main__":
    main()
