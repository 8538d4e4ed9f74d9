"""One exploration of a rectangle of 10 x 6 cm, from a cell to its figures (thesis tables 4.2 and 4.3)."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.coverage_criteria import GOAL, Definition, ExploredMap
from tactile_lab.experiments.data.explored_objects import ExploredObject, FixedObject, MovingObject
from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.experiments.data.planar_hand import PlanarHand, planned_rays
from tactile_lab.experiments.runs.limits.oracle import fewest_grasps
from tactile_lab.slam.exploration.information_policy import InformationPolicy
from tactile_lab.slam.exploration.policies import make_policy
from tactile_lab.slam.exploration.policy import Decision, Policy, Surface
from tactile_lab.slam.exploration.ten_candidates import TEN_PALMS, candidates_at, shift
from tactile_lab.slam.shape.surfaces.sampling import sample_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour

OUTLINE_m = OUTLINES_m["rectangle"]
TRUE_POINTS_m = sample_polygon(OUTLINE_m, 0.001)
MOST_GRASPS = 80
CLAIRVOYANT, INFORMED = "clairvoyant", "outline known"
"""Bounds: one policy knows even the errors of execution in advance, the other the true outline and the size of
errors.
"""

_SHIFT_m, _TURN_rad = 0.006, float(np.deg2rad(8.0))


def palms_called(name: str, seed: int) -> Array:
    """Palm poses relative to the object, as pose vectors (x m, y m, yaw rad): "10", "10 shifted" (each displaced by 6
    mm and 8 degrees), or "100" at random around the object, new for every seed.
    """
    if name == "100":
        rng = np.random.default_rng([seed, 100])
        spread = rng.uniform([-0.035, -0.010, 0.0], [0.035, 0.010, 2 * np.pi], (100, 3))
        return np.asarray(spread)
    return shift(TEN_PALMS, _SHIFT_m, _TURN_rad) if name == "10 shifted" else TEN_PALMS


def fixed_settings(grasps: int) -> list[Setting]:
    """Table 4.2: every policy with the ten candidates, the main ones with the others."""
    thesis = ("random", "variance", "clusters", "clusters-appendix", "entropy", "igef", "igef-shape")
    ours = ("information", INFORMED, CLAIRVOYANT)
    return [
        *grid(candidates=["10"], policy=[*thesis, *ours], grasps=[grasps]),
        *grid(candidates=["100"], policy=["random", "variance", *ours], grasps=[grasps]),
        *grid(candidates=["10 shifted"], policy=["random", "variance", "information"], grasps=[grasps]),
    ]


def moving_settings(grasps: int) -> list[Setting]:
    """Table 4.3: the thesis's filter with its policies, then all policies with the default method, and ours knowing the
    outline.
    """
    shape = ("random", "variance", "clusters", "entropy", "igef")
    everyone = (*shape, "det", "det-modes", "kl", "mutual-information", "renyi", "information", INFORMED)
    return [
        *grid(tracking=["thesis-pf"], policy=["random", "det", "kl"], grasps=[grasps]),
        *grid(tracking=["joint"], policy=everyone, grasps=[grasps]),
    ]


def explore_fixed(cell: Cell) -> dict[str, Any]:
    """Explore an object at a known, fixed pose. Cell: candidates, policy, grasps (the budget)."""
    hand = PlanarHand(OUTLINE_m, np.random.default_rng([cell.seed, 6]))
    palms = palms_called(cell["candidates"], cell.seed)
    if cell["policy"] == CLAIRVOYANT:
        return {"actions_B": fewest_grasps(hand, palms, "B", TRUE_POINTS_m, GOAL, cell["grasps"])}
    rng = np.random.default_rng([cell.seed, 5])
    run = Exploration(FixedObject(hand), palms, ("A3", "B"), cell["policy"], rng)
    return run.until_explored(cell["grasps"])


def explore_moving(cell: Cell) -> dict[str, Any]:
    """Explore an object that every grasp pushes with full motion noise; ten candidates. Cell: tracking, policy, grasps
    (the budget).
    """
    hand = PlanarHand(OUTLINE_m, np.random.default_rng([cell.seed, 16]))
    thing = MovingObject.track_by(cell["tracking"], hand, cell.seed)
    rng = np.random.default_rng([cell.seed, 15])
    run = Exploration(thing, TEN_PALMS, ("A5", "B"), cell["policy"], rng)
    return run.until_explored(cell["grasps"])


@dataclass
class Exploration:
    """One run: grasp, estimate the pose, check coverage, decide. The policy does not know the definition of coverage.

    Attributes:
        thing: the object to explore.
        palms: candidate poses relative to it.
        definitions: definitions of coverage; the run ends when the goal is reached by all of them.
        policy_name: name of the policy.
        rng: random numbers for the decisions.
    """

    thing: ExploredObject
    palms: Array
    definitions: tuple[Definition, ...]
    policy_name: str
    rng: np.random.Generator
    _actions: dict[Definition, int] = field(default_factory=dict)
    _shares: list[dict[Definition, float]] = field(default_factory=list)
    _decision_ms: list[float] = field(default_factory=list)
    _promises: list[float | None] = field(default_factory=list)

    def until_explored(self, budget: int) -> dict[str, Any]:
        """Grasp until the goal is reached or the budget is spent; the figures of the run."""
        policy = None if self.policy_name == INFORMED else make_policy(self.policy_name)
        chosen = int(self.rng.integers(len(self.palms)))
        for count in range(1, budget + 1):
            self.thing.grasp(self.palms[chosen])
            known = self.thing.map()
            if self._record_coverage(known, count):
                break
            decision = self._decide(policy, known)
            chosen = int(self.rng.integers(len(self.palms))) if decision.chosen is None else decision.chosen
            self._promises.append(decision.promised_gain)
        return self._figures()

    def _record_coverage(self, known: ExploredMap | None, count: int) -> bool:
        """Record the coverage; returns whether the goal is reached by all definitions."""
        self._shares.append(self._coverage(known))
        for definition, share in self._shares[-1].items():
            if share >= GOAL:
                self._actions.setdefault(definition, count)
        return len(self._actions) == len(self.definitions)

    def _coverage(self, known: ExploredMap | None) -> dict[Definition, float]:
        if known is None:
            return dict.fromkeys(self.definitions, 0.0)
        true_points = self.thing.in_map_frame(TRUE_POINTS_m)
        return {each: float(known.explored_points(each, true_points).mean()) for each in self.definitions}

    def _decide(self, policy: Policy | None, known: ExploredMap | None) -> Decision:
        """The policy's choice, and its computing time; random before the first contact."""
        if known is None:
            return Decision(self.policy_name, "nothing", None, (), "nothing has been touched yet")
        belief = self.thing.belief(known, self.rng)
        if policy is None:
            belief = replace(belief, surface=self._true_surface(), displacements_m=np.empty((0, 0)))
        candidates = candidates_at(self.palms, self.thing.world_T_body, planned_rays())
        started = time.perf_counter()
        decision = (policy or InformationPolicy()).choose(candidates, belief, self.rng)
        self._decision_ms.append(round(1e3 * (time.perf_counter() - started), 2))
        return decision

    def _true_surface(self) -> Surface:
        points = self.thing.in_map_frame(TRUE_POINTS_m)
        return Surface.of(Contour(points, np.zeros(len(points)), is_closed=True))

    def _kept_promises(self) -> list[list[float]]:
        """The predicted and the actual gain of each decision, by definition B."""
        shares = [share["B"] for share in self._shares]
        gained = np.diff(shares).tolist()
        return [[p, g] for p, g in zip(self._promises, gained, strict=False) if p is not None]

    def _figures(self) -> dict[str, Any]:
        actions = {f"actions_{each[0]}": self._actions.get(each) for each in self.definitions}
        return {
            **actions,
            "status": "ok" if len(self._actions) == len(self.definitions) else "not explored",
            "registration_mm": self.thing.registration_mm(),
            "decision_ms": self._decision_ms,
            "promises": self._kept_promises(),
        }
