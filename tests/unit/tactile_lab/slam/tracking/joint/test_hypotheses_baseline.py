"""Numbers of hypotheses and of what changes them, compared with those stored: any change of them is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.prism import Prism
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.joint.branching import Branching
from tactile_lab.slam.tracking.joint.deferred_association import associate_deferred, propose_pushes, relocate_last
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, likeliest, weights
from tactile_lab.slam.tracking.joint.low_discrepancy import sobol_points
from tactile_lab.slam.tracking.joint.mechanisms import Mechanisms
from tactile_lab.slam.tracking.joint.pose_covariance import PoseCovariances, with_covariances
from tactile_lab.slam.tracking.joint.pose_uncertainty import propagate_pose_uncertainty
from tactile_lab.slam.tracking.joint.proposals import GraspMatch, ProposalSettings, elsewhere, propose, quasi_normal
from tactile_lab.slam.tracking.joint.second_opinions import SecondOpinions
from tactile_lab.slam.tracking.joint.settings import JointSettings
from tactile_lab.slam.tracking.joint.trajectory_splicing import splice_trajectories
from tests.support.baseline import assert_baseline
from tests.support.baseline_problems import (
    KINDS,
    Kind,
    any_rows,
    felt,
    kernel,
    session,
    told,
    true_placed,
    unheld,
    varied_map,
)
from tests.support.digest import digest

NOISE = MotionNoise(translation_m=0.006, rotation_rad=0.2, unheld=0.15, palm_m=0.0007)
SETTINGS = ProposalSettings(samples=24)
CLOSE = {"rtol": 3e-4, "atol": 1e-5}
"""Variances in proposals and free space are computed in single precision."""


def scorer(mechanisms: Mechanisms | None = None) -> HypothesisScorer:
    return HypothesisScorer(NOISE, 2.0, mechanisms)


def spoilt(known: ContactMap, index: int, contacts: list[int]) -> ContactMap:
    """The map with some contacts of a grasp a centimetre and more off, with other normals."""
    grasp = known.placed[index]
    seen = grasp.contacts_world
    points, normals = seen.points_m.copy(), seen.normals.copy()
    for contact in contacts:
        points[contact] += 0.014 * seen.normals[contact] + 0.004
        normals[contact, :2] = normals[contact, 1::-1] * [1, -1]
    return known.with_placed(index, replace(grasp, contacts_world=replace(seen, points_m=points, normals=normals)))


def anywhere(known: ContactMap, contacts: ContactSet) -> Array:
    """Five places around the first grasp's, for a mechanism that asks for places on the object."""
    size = known.space.size
    steps = any_rows("space" if size == 6 else "plane", 5) * np.where(np.arange(size) < size // 3 + 1, 0.05, 0.1)
    return known.space.move(known.rows[0] + np.zeros((5, size)), steps)


@pytest.mark.parametrize("kind", KINDS)
def test_hypotheses_are_scored_smoothed_and_cleaned(kind: Kind) -> None:
    """A trajectory in which much happens, with a wrong contact: its costs before and after smoothing, cleaning and
    summarizing.
    """
    known, judge = spoilt(varied_map(kind), 3, [1]), scorer()
    one = judge.score(known)
    cleaned, cost = judge.clean(known)
    of_one, _ = judge.clean(known, 2)
    every = np.ones(len(known.placed[2].contacts_world), dtype=bool)
    by_touch = replace(known.placed[2], contacts_world=replace(known.placed[2].contacts_world, probed=every))
    values = {
        "score": told(one),
        "smoothed": told(judge.smooth(known, 4)),
        "cleaned": [[sorted(each.left_out) for each in cleaned.placed], cost],
        "cleaned one": [sorted(each.left_out) for each in of_one.placed],
        "only touched": [sorted(each.left_out) for each in judge.clean(known.with_placed(2, by_touch))[0].placed],
        "condensed": told(judge.condense(one, 2, 10)),
        "dear contacts": [sorted(one.left_out) for one in HypothesisScorer(NOISE, 0.3).clean(known)[0].placed],
    }
    assert_baseline(f"tracking/joint/hypotheses-{kind}", values, **CLOSE)


@pytest.mark.parametrize("kind", KINDS)
def test_a_contact_probed_before_the_closing_is_not_left_out(kind: Kind) -> None:
    """Of an object left in place: a wrong contact of the closing is left out, one probed before stays."""
    known, judge = spoilt(varied_map(kind), 3, [1]), HypothesisScorer(NOISE, 0.3)
    grasp = replace(known.placed[3], motion=np.zeros_like(known.placed[3].motion), motion_sigma=None)
    closed = judge.clean(known.with_placed(3, grasp), 3)[0].placed[3].left_out
    assert 1 in closed
    mask = np.arange(len(grasp.contacts_world)) == 1
    probed = replace(grasp, contacts_world=replace(grasp.contacts_world, probed=mask))
    left_out = judge.clean(known.with_placed(3, probed), 3)[0].placed[3].left_out
    assert 1 not in left_out


@pytest.mark.parametrize("kind", KINDS)
def test_equal_trajectories_count_once(kind: Kind) -> None:
    """Trajectories ever farther along a direction, and one with another contact left out: which are kept, and how
    likely they are.
    """
    judge = scorer()
    known = judge.smooth(varied_map(kind), 6).map
    steps = np.where(np.arange(known.space.size) < known.space.translations, 0.001, 0.02)
    away = np.cos(np.arange(known.rows.size)).reshape(known.rows.shape) * (np.arange(len(known.rows)) > 0)[:, None]
    factors = [0.0, 0.2, 0.4, 0.7, 1.0, 1.5, 2.2, 3.0, 5.0]
    maps = [known.with_rows(known.space.move(known.rows, f * steps * away)) for f in factors]
    maps.append(maps[1].without_contact(2, 0))
    found = [judge.score(each) for each in maps]
    number = {id(one): place for place, one in enumerate(found)}
    plain = scorer(Mechanisms(frozenset({"valleys"})))
    values = {
        "costs": [one.cost for one in found],
        "different": [number[id(one)] for one in judge.different(found)],
        "by poses": [number[id(one)] for one in judge.different(found, by_contacts=False)],
        "without valleys": [number[id(one)] for one in plain.different(found)],
        "unlike": [number[id(one)] for one in judge.unlike(found, found[4:5])],
        "likeliest": [number[id(one)] for one in likeliest(found, 6, 8.0)],
        "weights": weights(found),
    }
    assert_baseline(f"tracking/joint/equal-{kind}", values, **CLOSE)


def test_the_price_of_wrong_contacts_and_of_steps() -> None:
    """None, one and many contacts left out; steps pushed and free."""
    known, judge = true_placed(session("plane"), "plane"), scorer()
    prices = []
    for count in range(4):
        for moved in Moved:
            grasp = replace(known.placed[3], moved=moved, left_out=frozenset(range(count)))
            prices.append(judge.price(known.with_placed(3, grasp)))
    assert_baseline("tracking/joint/price", {"prices": prices})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("step", ["carried", "felt"])
def test_poses_are_proposed(kind: Kind, step: str) -> None:
    """The last grasp driven onto the field of the others, by a slip of the usual kind and by one of its own noise."""
    known = true_placed(felt(session(kind), 4), kind)
    last, before = known.placed[-1], replace(known, placed=known.placed[:-1])
    noise = NOISE.after(last.motion, last.motion_sigma if step == "felt" else None)
    predicted = known.space.compose(last.motion, before.placed[-1].pose)
    rows, fit = propose(predicted, last.contacts_world, before.fit(), noise, SETTINGS, known.space)
    match = GraspMatch(predicted, last.contacts_world, before.fit(), noise, SETTINGS, known.space)
    around = known.space.move(predicted, 0.1 * any_rows(kind, 5))
    there = match.fit(around, match.variance(around))
    places = {
        "rows": rows[:6],
        "elsewhere": elsewhere(around, predicted, SETTINGS, known.space),
        "elsewhere proposed": elsewhere(rows, rows[0], SETTINGS, known.space),
    }
    costs = {
        "costs": fit.cost,
        "there": [there.cost, np.linalg.norm(there.information), np.linalg.norm(there.gradient)],
        "variance in square millimetres": 1e6 * match.variance(around),
    }
    assert_baseline(f"tracking/proposals/{kind}-{step}", places, **CLOSE)
    assert_baseline(f"tracking/proposals/{kind}-{step}-costs", costs, rtol=1e-3, atol=1e-3)


def test_samples_are_spread_evenly() -> None:
    """The first points of the sequence in six dimensions, and the normal vectors made of them."""
    points = sobol_points(37, 6, np.random.default_rng(8))
    values = {"points": points[[0, 1, 2, 17, 36]], "all": digest(points), "normal": digest(quasi_normal(37, 6))}
    assert_baseline("tracking/joint/samples", values)


@pytest.mark.parametrize("kind", KINDS)
def test_hypotheses_branch(kind: Kind) -> None:
    """A grasp that fits, one whose contacts are mostly wrong, and one without contacts, after a grasp put aside."""
    known = true_placed(unheld(felt(session(kind), 3), 4), kind)
    last = spoilt(known, 4, [0]).placed[4]
    lost = spoilt(known, 4, [0, 1, 2]).placed[4].contacts_world
    judge, settings = scorer(), JointSettings(proposals=SETTINGS, smoothed=2)
    before = replace(known, placed=known.placed[:4])
    starts = [judge.score(before), judge.score(before.with_placed(3, before.placed[3].put_aside()))]
    values: dict[str, Any] = {}
    none = last.contacts_world.select(np.zeros(len(last.contacts_world), dtype=bool))
    for name, contacts in (("fits", last.contacts_world), ("lost", lost), ("none", none)):
        branching = Branching(contacts, last.motion, last.motion_sigma, NOISE, judge, settings, known.space)
        found = branching.branches(starts)
        covariances = [digest(one.map.placed[-1].covariance) for one in found[:3]]
        values[name] = [[told(one) for one in found[:3]], covariances, [one.cost for one in found]]
    assert_baseline(f"tracking/joint/branches-{kind}", values, **CLOSE)


@pytest.mark.parametrize("by_touch", [False, True])
def test_a_surprise_asks_for_another_kernel(by_touch: bool) -> None:
    """Contacts on top of a block of which only the walls are known, the block left in place."""
    known = true_placed(unheld(session("table", count=3, seed=4), 2), "table")
    rows = known.rows
    rows[2] = rows[1]
    known = spoilt(known.with_rows(rows), 2, [2])
    judge, settings = scorer(), JointSettings(proposals=SETTINGS, smoothed=2)
    last = known.placed[2]
    contacts = replace(last.contacts_world, probed=np.full(len(last.contacts_world), by_touch))
    branching = Branching(contacts, last.motion, None, NOISE, judge, settings, known.space)
    start = judge.score(replace(known, placed=known.placed[:2]))
    found = branching.branches([start])
    again = branching.surprised([start], found[0])
    values = {"usual": told(found[0]), "again": [told(one) for one in again[:2]], "count": [len(found), len(again)]}
    assert_baseline(f"tracking/joint/surprised-{'touch' if by_touch else 'grasp'}", values, **CLOSE)


@pytest.mark.parametrize("kind", ["plane", "space"])
def test_grasps_are_placed_later(kind: Kind) -> None:
    """A grasp aside and one with two wrong contacts, left in place: placed near, after a push, or anywhere."""
    known = true_placed(unheld(session(kind), 4), kind)
    rows = known.rows
    rows[4] = known.space.move(rows[4], np.where(np.arange(known.space.size) < 2, 0.006, 0.03))
    doubtful = spoilt(known.with_rows(rows), 4, [0]).without_contact(4, 0).without_contact(4, 1)
    judge = scorer()
    start = judge.score(doubtful)
    aside = judge.score(doubtful.with_placed(4, doubtful.placed[4].put_aside()))
    middle = judge.score(known.with_placed(2, known.placed[2].put_aside()))
    two = known.with_placed(2, known.placed[2].put_aside()).with_placed(3, known.placed[3].put_aside())
    values = {
        "start": told(start),
        "pushed": [told(one) for one in propose_pushes(start, NOISE, SETTINGS, judge)],
        "anywhere": [told(one) for one in relocate_last(aside, anywhere, judge)],
        "later": told(associate_deferred(aside, NOISE, SETTINGS, anywhere, judge)),
        "later without pushes": told(associate_deferred(start, NOISE, SETTINGS, None, judge, pushes=False)),
        "middle": told(associate_deferred(middle, NOISE, SETTINGS, None, judge)),
        "two in a row": told(associate_deferred(judge.score(spoilt(two, 3, [0, 1, 2])), NOISE, SETTINGS, None, judge)),
    }
    assert_baseline(f"tracking/joint/deferred-{kind}", values, **CLOSE)


def test_what_was_felt_to_stand_still_is_not_found_elsewhere_for_the_price_of_a_lost_object() -> None:
    """Not felt, the object was lost at one price, wherever it is found; felt, that costs as much as it is far."""
    known, judge = true_placed(unheld(session("plane"), 4), "plane"), scorer()
    aside = known.placed[4].put_aside()
    stood = replace(aside, motion_sigma=StepSigma(translation_m=0.00025, rotation_rad=0.005))
    lost, felt_still = (
        relocate_last(judge.score(known.with_placed(4, one)), anywhere, judge) for one in (aside, stood)
    )
    assert any(one.map.placed[4].moved is Moved.FREELY for one in lost)
    assert felt_still
    assert all(one.map.placed[4].moved is Moved.AS_MEANT for one in felt_still)
    assert min(one.cost for one in felt_still) > min(one.cost for one in lost)


@pytest.mark.parametrize("kind", KINDS)
def test_trajectories_are_spliced(kind: Kind) -> None:
    """A wrong turn after two of six grasps, and one before the last two: the halves joined anew."""
    known = true_placed(session(kind, count=6), kind, off=0.3)
    space, values = known.space, {}
    for first in (2, 4):
        rows = known.rows
        turn = np.where(np.arange(space.size) < space.translations, 0.02, 0.5)
        rows[first:] = space.compose(rows[first:], turn)
        found = splice_trajectories(known.with_rows(rows), NOISE, SETTINGS)
        values[f"from {first}"] = [len(found), *(one.rows for one in found)]
    assert_baseline(f"tracking/joint/spliced-{kind}", values, rtol=3e-4, atol=1e-4)


def test_second_opinions_splice_the_best() -> None:
    """Two hypotheses in the plane, both with a wrong turn: what is kept, and which mechanisms acted."""
    known = true_placed(session("plane", count=6), "plane", off=0.3)
    rows = known.rows
    rows[3:] = known.space.compose(rows[3:], np.array([0.02, 0.01, 0.6]))
    mechanisms, settings = Mechanisms(), JointSettings(proposals=SETTINGS, smoothed=2, hypotheses=3)
    judge = scorer(mechanisms)
    starts = [judge.score(known.with_rows(rows)), judge.score(known.with_rows(rows).without_contact(2, 1))]
    found = SecondOpinions(judge, NOISE, settings, mechanisms, None).splice_best(starts)
    values = {"found": [told(one) for one in found], "changed": sorted(mechanisms.changed)}
    assert_baseline("tracking/joint/second-opinions", values, **CLOSE)


@pytest.mark.parametrize("kind", KINDS)
def test_covariances_of_a_finished_trajectory(kind: Kind) -> None:
    """In the first grasp's frame and in the common one, by faces; and by the field of a few contacts."""
    known = true_placed(session(kind), kind, off=0.3)
    few = replace(known, placed=known.placed[:2])
    found, little = PoseCovariances.of(known, NOISE), PoseCovariances.of(few, NOISE)
    values = {
        "birth": found.birth[[1, 4]],
        "common": found.common[[0, 3]],
        "all": [digest(found.birth), digest(found.common)],
        "few": [digest(little.birth), digest(little.common)],
        "alone": digest(PoseCovariances.of(replace(known, placed=known.placed[:1]), NOISE).common),
        "taken over": digest([each.covariance for each in with_covariances(known, found.birth).placed]),
    }
    assert_baseline(f"tracking/certainty/poses-{kind}", values, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("faceted", [True, False])
def test_an_outline_as_uncertain_as_the_poses(faceted: bool) -> None:
    """The outline of a rectangle, and of the field of an ellipse, with what poses and fingers add."""
    known = true_placed(session("plane", "rectangle" if faceted else "ellipse"), "plane", off=0.3)
    fitted = known.fit()
    shape = best_shape(fitted, known.free_points_m) if faceted else GpisShape(fitted)
    outline = shape.contour(0.004)
    found = propagate_pose_uncertainty(outline, shape, known, NOISE)
    values = {
        "sigma": found.sigma_m[:: max(1, len(found.sigma_m) // 12)],
        "all": digest(found.sigma_m),
        "shared": found.shared_sigma_m,
        "kernel": kernel(known),
    }
    assert_baseline(f"tracking/certainty/outline-{'faces' if faceted else 'field'}", values, rtol=1e-5)


@pytest.mark.parametrize(
    ("shape", "name", "kind"),
    [
        ("box-12x6x6", "planes", "table"),
        ("box-12x6x6", "outline", "table"),
        ("cylinder", "outline", "table"),
        ("sphere", "field", "table"),
        ("box-12x6x6", "planes", "space"),
    ],
)
def test_a_surface_as_uncertain_as_the_poses(shape: str, name: str, kind: Kind) -> None:
    """A block by its planes and by its outline, a cylinder by its outline, a ball by its field; a block held free."""
    known = true_placed(session(kind, shape, count=6), kind, off=0.3)
    fitted = known.fit()
    makers: dict[str, Callable[[], FittedShape]] = {
        "planes": lambda: Polyhedron.fit(fitted, upright=kind == "table"),
        "outline": lambda: Prism.fit(fitted, best_shape),
        "field": lambda: GpisShape(fitted),
    }
    model = makers[name]()
    seen = known.contacts
    sigma_m = np.full(len(seen), 0.0004)
    places = SurfaceMesh(seen.points_m, np.array([[0, 1, 2]]), sigma_m, seen.normals, is_closed=True)
    found = propagate_pose_uncertainty(places, model, known, NOISE)
    values = {"sigma in mm": 1e3 * found.sigma_m, "shared in mm": 1e3 * found.shared_sigma_m}
    assert_baseline(f"tracking/certainty/surface-{shape}-{name}-{kind}", values, rtol=1e-4)


def test_the_cost_of_a_hypothesis_is_the_sum_of_its_parts() -> None:
    known = true_placed(session("plane"), "plane")
    assert Hypothesis(replace(known, settled_cost=4.0), 1.0, 2.0, 3.5).cost == 10.5
