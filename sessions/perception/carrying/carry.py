"""How an object was carried from one place to another, and how far that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import FINGERS, Array, Contact, StepSigma
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_noise import UNPUSHED, CarryNoise, LinkTimes
from sessions.perception.carrying.carry_record import CarrySamples
from sessions.perception.carrying.friction_balance import Balance, Friction, MeasuredFriction, compose_steps
from sessions.perception.carrying.lifted import dropped_m, lifted_motions, raised
from sessions.perception.carrying.planar_motions import displacements, planar_matrices
from sessions.perception.carrying.resistance import Resistance
from sessions.perception.carrying.resting import at_rest
from sessions.perception.carrying.roundness import Roundness
from sessions.perception.carrying.tilt import tilt_rad
from sessions.perception.carrying.tip_steps import HELD_BY, TipSteps, tip_steps

_ITERATIONS, _ITERATIONS_OF_OTHERS = 8, 3
"""Half as many more change a carry by less than 0.03 mm and 0.02 degrees."""
_LEAST_HALF_WIDTH_m, _LARGEST_HALF_WIDTH_m = 0.017, 0.083
_FAR_m, _FAR_rad = 0.004, float(np.deg2rad(5.0))
"""A slip that a person should hear of: more than half of the rigs' usual ones."""
_CLOSES_m_s = 0.008
"""Fingers that feel nothing go on closing this fast, and may push the object with a link."""
_USUAL_NET_N, _PUSHED_SHARE = 0.8, 0.9
"""Net force with which objects are dragged over a table, and which quantile of a carry's is compared with it."""
_FARTHER_THE_LONGER = 1.25
"""Power of the time for which a link pushes: at first it slips along the object."""
_SLIDES_m_s, _SLIDES_N = 0.010, 0.2
"""A fingertip that moves faster than this along the object, and presses more, counts as sliding."""
_FARTHER, _TURNS_rad = 2.0, 0.005
"""Fingertips move the object as far as themselves, or a little farther where it turns, and a hand that turns so fast in
a step turns it with itself.
"""
_NO_HOLD_s = 0.05
"""Contacts may be missed for a few samples."""


@dataclass(frozen=True)
class Carry:
    """One carry.

    Attributes:
        motion: of the object on the table, world frame: new pose = motion * old pose.
        sigma: its standard deviations at the next grasp.
        slip_m, slip_rad: motion of the object's middle relative to the palm, and its turn.
        loose_s: how long no fingertip touched the object.
        single_s: how long only one did.
        resisted_N: force with which the object resisted, beyond what a table's friction explains; 0 if it did not.
        tilted_rad: how far it leaned at the end; 0 if it stood.
        dropped_m: how high above where it was grasped it was lost; 0 if it was not lost up there.
        void: fingertips without valid readings for a while.
        sliding: ratio of tangential to normal force at contacts that slid, shape (n,).
    """

    motion: Pose2
    sigma: StepSigma
    slip_m: float
    slip_rad: float
    loose_s: float
    single_s: float
    resisted_N: float
    void: tuple[str, ...]
    tilted_rad: float = 0.0
    dropped_m: float = 0.0
    sliding: Array = field(default_factory=lambda: np.zeros(0))

    def in_words(self) -> str:
        """The carry in words, for people."""
        slipped = f"slipped {1e3 * self.slip_m:.0f} mm, {np.degrees(self.slip_rad):.0f} degrees"
        return "; ".join([slipped, *self.problems])

    @property
    def is_remarkable(self) -> bool:
        """Whether it slipped far, or cannot be known well."""
        return self.slip_m > _FAR_m or self.slip_rad > _FAR_rad or bool(self.problems)

    @property
    def problems(self) -> tuple[str, ...]:
        """What makes this carry less certain, in words."""
        found = [f"{', '.join(self.void)} without valid readings"] if self.void else []
        if self.single_s > _NO_HOLD_s:
            found.append(f"held by one fingertip for {self.single_s:.1f} s")
        if self.loose_s > _NO_HOLD_s:
            found.append(f"touched by no fingertip for {self.loose_s:.1f} s")
        if self.dropped_m:
            found.append(f"dropped from {1e3 * self.dropped_m:.0f} mm")
        if self.tilted_rad:
            found.append(f"the object leans by {np.degrees(self.tilted_rad):.0f} degrees: has it fallen over?")
        if self.resisted_N:
            found.append(f"the object resisted with {self.resisted_N:.1f} N: is it jammed, or held by something?")
        return tuple(found)


class CarryOdometry:
    """Estimates carries; knows from earlier grasps how large the object is.

    Args:
        fingertips: that measure contacts while they move, by finger.
        side: of the hand.
        scale: factor of the stated standard deviations.
    """

    def __init__(self, fingertips: Mapping[str, ContinuousFingertip], side: Side, scale: float = 1.0) -> None:
        self._fingertips, self._side, self._scale = fingertips, side, scale
        self._spans_m: list[float] = []
        self.noise = CarryNoise()
        self.measured = MeasuredFriction()
        """What was measured of the object's friction by dragging it, or in earlier carries."""

    def on_grasp(self, contacts: Sequence[Contact]) -> None:
        """Contacts of a grasp: they show the size of the object's foot."""
        if len(contacts) > 1:
            places_m = np.array([contact.point_world_m[:2] for contact in contacts])
            gaps = places_m[:, None] - places_m[None]
            self._spans_m.append(float(np.linalg.norm(gaps, axis=-1).max()))

    @property
    def friction(self) -> Friction:
        """What is assumed of the object: what was measured, and what is usual of the rest."""
        half_m = sum(self._spans_m) / len(self._spans_m) / 2 if self._spans_m else 0.05
        half_width_m = min(max(half_m, _LEAST_HALF_WIDTH_m), _LARGEST_HALF_WIDTH_m)
        return self.measured.known(Friction(half_width_m=half_width_m))

    @property
    def stood(self) -> StepSigma:
        """How far an object may have moved that stood while it was touched."""
        return StepSigma(self._scale * self.noise.stood_m, self._scale * self.noise.stood_rad)

    def closed(
        self, sigma: StepSigma, closing_N: float, links: LinkTimes = UNPUSHED, given_way_m: float = 0.0
    ) -> StepSigma:
        """How well the object's place is known once the hand has closed again.

        Args:
            sigma: before.
            closing_N: largest net force of the fingertips meanwhile.
            links: how long links pushed.
            given_way_m: how far the object moved under a fingertip; it may have turned about anything within its
                width.
        """
        excess_N, noise = max(closing_N - _USUAL_NET_N, 0.0), self.noise
        pushed = float(np.hypot(links.opened_s**_FARTHER_THE_LONGER, links.closed_s**_FARTHER_THE_LONGER))
        causes = self._scale * np.array([excess_N, pushed, links.landed_s])
        moved_m = self._scale * given_way_m
        turned_rad = moved_m / self.friction.half_width_m
        translation_m = np.linalg.norm([sigma.translation_m, moved_m, *causes * noise.after_m])
        rotation_rad = np.linalg.norm([sigma.rotation_rad, turned_rad, *causes * noise.after_rad])
        return StepSigma(float(translation_m), float(rotation_rad))

    def estimate(self, samples: CarrySamples) -> Carry:
        """The carry by these samples."""
        return self.carry(tip_steps(samples, self._fingertips, self._side))

    def carry(self, steps: TipSteps) -> Carry:
        """The carry that these steps make; deterministic."""
        balance, usual = Balance.of(steps), self.friction
        best = balance.solve([usual], _ITERATIONS)[0]
        others = balance.solve(_other_assumptions(usual, self.measured), _ITERATIONS_OF_OTHERS, best)
        answers = np.concatenate([best[None], others, best[None]])  # the last one knows no rest
        answers[:-1, at_rest(steps, usual)] = 0.0
        if (up := raised(steps)).any():
            answers[:, up] = lifted_motions(steps, up, balance.centres_m, usual)
        motions = compose_steps(answers, balance.centres_m)
        palm = planar_matrices(steps.world_T_palm[[0, -1]])[0]
        middle = balance.centres_m[0]
        ends = displacements(motions, middle)
        slip = displacements(np.linalg.inv(palm) @ motions[0], middle)
        loose_s, single_s = (float(steps.step_s @ (steps.felt.sum(axis=1) == count)) for count in (0, 1))
        tilted_rad, fell_m, resistance = tilt_rad(steps), dropped_m(steps), Resistance.of(steps, usual)
        void_s = steps.step_s @ (steps.is_void & [finger in self._fingertips for finger in FINGERS])
        return Carry(
            motion=_pose(motions[0]),
            sigma=self._sigma(
                ends.std(axis=0),
                slip,
                steps,
                balance,
                self._unseen(steps, balance.centres_m, tilted_rad, fell_m, resistance.doubt)
                + _squeezed_out(steps, best),
            ),
            slip_m=float(np.hypot(*slip[:2])),
            slip_rad=float(abs(slip[2])),
            loose_s=loose_s,
            single_s=single_s,
            resisted_N=resistance.resisted_N,
            tilted_rad=tilted_rad,
            dropped_m=fell_m,
            void=tuple(finger for finger, seconds in zip(FINGERS, void_s, strict=True) if seconds > _NO_HOLD_s),
            sliding=_sliding_ratios(steps, balance.sliding_m(best)),
        )

    def _unseen(self, steps: TipSteps, centres_m: Array, tilted_rad: float, fell_m: float, doubt: Array) -> Array:
        """Motion that was not seen, metres and radians: of the hand in doubtful steps, of what tips over, and of what
        falls, which may go as far aside as down.
        """
        unseen_m, unseen_rad = _unseen(steps, centres_m, self._fingertips, doubt)
        half_m, closing_m = self.friction.half_width_m, _CLOSES_m_s * float(steps.step_s @ (steps.felt.sum(axis=1) < 2))
        turned_rad = unseen_rad + (closing_m + fell_m) / half_m + tilted_rad
        return np.array([unseen_m + closing_m + fell_m + 2 * half_m * tilted_rad, turned_rad])

    def _sigma(self, spread: Array, slip: Array, steps: TipSteps, balance: Balance, unseen: Array) -> StepSigma:
        noise, held = self.noise, Roundness.of(steps, balance)
        far_m, far_rad, turned_rad = np.hypot(*spread[:2]) / np.sqrt(2), spread[2], abs(slip[2])
        pressed_N, pushed_N = float(steps.forces_N[-1].sum()), _pushed_N(steps)
        held_rad = [
            noise.least_rad + noise.spread_rad * far_rad + noise.turned_rad * turned_rad**2,
            noise.missing_rad * turned_rad * _missing(steps),
            noise.let_go_rad_N * pressed_N,
            noise.pushed_rad_N * pushed_N,
            noise.unseen * unseen[1],
        ]
        free_rad, by_two = noise.round_rad * held.turns * steps.palm_turns_rad, steps.felt.sum(axis=1) == HELD_BY
        parts_m = [
            noise.least_m + noise.spread_m * far_m,
            noise.roll_m * held.overhang,
            noise.vertical_m_N * _vertical_N(steps),
            noise.pushed_m_N * pushed_N,
            noise.unseen * unseen[0],
            noise.aside * self.friction.half_width_m * np.linalg.norm([*held_rad, free_rad[by_two].sum()]),
        ]
        rotation_rad = np.linalg.norm([*held_rad, free_rad.sum()])
        return StepSigma(self._scale * float(np.linalg.norm(parts_m)), self._scale * float(rotation_rad))


def _missing(steps: TipSteps) -> float:
    """How many of the five fingertips did not hold the object, in the mean: each that does checks its turn."""
    return len(FINGERS) - float(steps.felt.sum(axis=1).mean())


def _vertical_N(steps: TipSteps) -> float:
    """Vertical force of the fingertips, up or down, while the hand is not raised."""
    low = ~raised(steps)
    return abs(float(np.median(steps.net_forces_N[low, 2]))) if low.any() else 0.0


def _other_assumptions(usual: Friction, measured: MeasuredFriction) -> Sequence[Friction]:
    """Others that cannot be excluded; what they change is what is not known."""
    return (
        replace(usual, tips=max(0.3, measured.tips_at_least)),
        replace(usual, tips=max(1.0, usual.tips)),
        replace(usual, half_width_m=usual.half_width_m / 1.5),
        replace(usual, half_width_m=1.5 * usual.half_width_m),
        replace(usual, table_N=measured.least_table_N),
        replace(usual, normal_weight=usual.normal_weight / 5),
        replace(usual, give_m=0.0),
        replace(usual, give_m=2 * usual.give_m),
    )


def _sliding_ratios(steps: TipSteps, sliding_m: Array) -> Array:
    """Tangential over normal force at the contacts that slide; theirs is the edge of the friction cone."""
    slides = (sliding_m > _SLIDES_m_s * steps.step_s[:, None]) & (steps.forces_N > _SLIDES_N)
    return np.asarray(steps.tangential_N[slides] / steps.forces_N[slides])


def _pushed_N(steps: TipSteps) -> float:
    """Net force of the fingertips beyond what a table's friction explains, N."""
    net_N = np.sort(steps.pushed_N)
    return max(float(net_N[int(_PUSHED_SHARE * (len(net_N) - 1))]) - _USUAL_NET_N, 0.0)


def _unseen(steps: TipSteps, centres_m: Array, fingertips: Mapping[str, ContinuousFingertip], doubt: Array) -> Array:
    """The hand's motion, metres and radians, in steps that too few fingertips measure; shape (2,)."""
    wired = [finger in fingertips for finger in FINGERS]
    poorly = (steps.felt.sum(axis=1) < 2) | (steps.is_void & wired).any(axis=1)
    doubt = np.maximum(poorly, doubt)
    if not doubt.any():
        return np.zeros(2)
    moves = steps.palm_moves
    shifts = np.einsum("nij,nj->ni", moves[:, :2, :2], centres_m) + moves[:, :2, 2] - centres_m
    return np.array([np.linalg.norm(shifts, axis=1) @ doubt, steps.palm_turns_rad @ doubt])


def _squeezed_out(steps: TipSteps, motions: Array) -> Array:
    """How much farther than fingertips go, and turn than the hand turns, the object does, m and rad: contacts that all
    give way squeeze it out in the balance.
    """
    tips_m = np.where(steps.felt, np.linalg.norm(steps.moves_m, axis=-1), 0.0).max(axis=1)
    farther_m = np.hypot(motions[:, 0], motions[:, 1]) - _FARTHER * tips_m
    turns_rad = steps.palm_turns_rad
    more_rad = np.where(turns_rad > _TURNS_rad, np.abs(motions[:, 2]) - _FARTHER * turns_rad, 0.0)
    return np.array([np.maximum(farther_m, 0.0).sum(), np.maximum(more_rad, 0.0).sum()])


def _pose(motion: Array) -> Pose2:
    return Pose2(float(motion[0, 2]), float(motion[1, 2]), float(np.arctan2(motion[1, 0], motion[0, 0])))
