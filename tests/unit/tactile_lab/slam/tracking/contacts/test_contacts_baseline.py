"""Numbers of contacts, pose vectors and motion, compared with those stored: any change of them is told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.core.contacts import StepSigma
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet, placement_sigma_m, planar_rotation
from tactile_lab.slam.tracking.contacts.first_pose import first_pose_vector
from tactile_lab.slam.tracking.contacts.free_space import free_space_costs
from tactile_lab.slam.tracking.contacts.measured_law import heavy_tailed_cost, heavy_tailed_weight
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, sample_motion
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR, PoseVectors
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL
from tests.support.baseline import assert_baseline
from tests.support.baseline_problems import KINDS, Kind, any_rows, kernel, pathless, session, turned_by, varied_map

NOISE = MotionNoise(unheld=0.15)


def contents(contacts: ContactSet) -> dict[str, Any]:
    shared = contacts.shared.of_count(len(contacts))
    return {
        "points": contacts.points_m,
        "normals": contacts.normals,
        "sigmas": [contacts.point_sigma_m, contacts.normal_sigma_rad],
        "free": contacts.free_m,
        "owners": contacts.free_of,
        "by touch": contacts.by_touch,
        "shared": shared.sigma_m,
        "displacements": shared.displacements_m(),
    }


@pytest.mark.parametrize("kind", KINDS)
def test_contacts_of_a_grasp(kind: Kind) -> None:
    """Points, normals, uncertainties and free places of a grasp: with paths, without them, and with a wild contact."""
    data = session(kind, count=2, seed=5)
    dimension = 2 if kind == "plane" else 3
    known, unknown = data.grasps[1], pathless(data).grasps[1]
    steep = replace(known.contacts[1], normal_world=np.array([0.5, 0.2, 0.7]), normal_sigma_rad=0.02, probed=True)
    sure = replace(known.contacts[2], point_covariance_m2=np.diag([1e-18, 1e-18, 1e-18]), normal_sigma_rad=0.0)
    level = replace(known.contacts[0], normal_world=np.array([0.1, 0.0, 0.99]))
    missed = replace(known.approach_paths[3], touched=False)
    first = known.approach_paths[0]
    near = replace(first, start_world_m=first.end_world_m + np.array([0.002, 0.0, 0.001]))
    odd = replace(
        known,
        contacts=(level, steep, sure, *known.contacts[3:]),
        approach_paths=(near, *known.approach_paths[1:3], missed, *known.approach_paths[4:]),
    )
    values = {
        name: contents(ContactSet.of_grasp(grasp, dimension, height_m))
        for name, grasp, height_m in (("known", known, 0.01), ("unknown", unknown, 0.0), ("odd", odd, 0.02))
    }
    assert_baseline(f"tracking/contacts/contacts-{kind}", values)


@pytest.mark.parametrize(("name", "space"), [("planar", PLANAR), ("spatial", SPATIAL)])
def test_pose_vectors(name: Kind, space: PoseVectors) -> None:
    """Composition, inverse, differences and derivatives of poses all over the place, some turned by nearly half."""
    kind: Kind = "plane" if name == "planar" else "space"
    rows, motions, dimension = any_rows(kind, 7), any_rows(kind, 8)[1:], 3
    steps = 0.4 * any_rows(kind, 9)[2:]
    points, normals = any_rows("space", 7)[:, :dimension], np.cos(any_rows("space", 7)[:, 3:])
    placed = space.to_object(rows, points, normals)
    later, earlier = space.slip_derivatives(rows, motions)
    values = {
        "compose": space.compose(motions, rows),
        "inverse": space.inverse(rows),
        "deviation": space.deviation(rows, motions),
        "move": space.move(rows, steps),
        "placed": placed,
        "by row": space.by_row(rows, *placed, normals, points),
        "later": later,
        "earlier": earlier,
        "sigmas": space.sigmas(NOISE),
        "motion": space.motion(turned_by(0.4)),
        "pose": space.pose(rows[2], 0.3).matrix(),
    }
    assert_baseline(f"tracking/contacts/pose-vectors-{name}", values)


def test_motion_noise() -> None:
    """The noise of a step carried, left in place, felt and not measured for a while; samples and heavy tails."""
    carried, still = np.array([0.02, 0.01, 0.3]), np.zeros(3)
    sigma, tiny = StepSigma(0.002, 0.03), StepSigma(1e-9, 1e-9)
    felt = NOISE.after(carried, sigma)
    steps = np.array([carried, 2 * carried, still])
    noises = {
        "carried": NOISE.after(carried),
        "still": NOISE.after(still),
        "felt": felt,
        "surely felt": NOISE.after(carried, tiny),
        "wide": NOISE.wide,
        "felt and wide": felt.wide,
        "three, one not felt": NOISE.over(steps, [sigma, None, sigma]),
        "three felt": NOISE.over(steps, [sigma, StepSigma(0.001, 0.05), sigma]),
        "two still": NOISE.over(steps[2:], [None]),
        "accumulated": NOISE.accumulate(5),
    }
    squared, dimensions = np.array([0.0, 0.5, 3.0, 40.0, 900.0]), np.array([1, 2, 3, 1, 2])
    values: dict[str, Any] = {
        name: [*one.sigmas, one.palm_m, one.gripped, one.is_heavy_tailed] for name, one in noises.items()
    }
    values["tail"] = [heavy_tailed_cost(squared, dimensions), heavy_tailed_weight(squared, dimensions)]
    values["samples"] = sample_motion(any_rows("plane", 6), carried, NOISE, np.random.default_rng(4))
    values["rotation"] = planar_rotation(0.7)
    assert_baseline("tracking/contacts/motion-noise", values)


@pytest.mark.parametrize("kind", KINDS)
def test_a_map_of_contacts(kind: Kind) -> None:
    """What a map of varied grasps tells: which contacts count, where free places are, its kernel, its other reading."""
    known = varied_map(kind)
    backward = replace(
        known.with_rows(known.space.move(known.rows, 0.01 * any_rows(kind, 5))), placed=known.placed[::-1]
    )
    again = known.reread(backward)
    aside = known.with_placed(2, known.placed[2].put_aside())
    values = {
        "contacts": known.contacts.points_m,
        "origins": known.origins,
        "free": known.free_points_m.sum(axis=0),
        "free aside": aside.free_points_m.sum(axis=0),
        "left in place": [one.was_left(NOISE) for one in known.placed],
        "was left": [one.was_left(NOISE) for one in aside.placed],
        "kernel": kernel(known.with_best_kernel()),
        "short kernel": kernel(known.with_best_kernel(2, 0.05)),
        "reread": again.rows,
        "reread moved": [how.value for how in again.moved],
        "reread left out": [sorted(one.left_out) for one in again.placed],
        "last used": [aside.last_used, aside.trailing_unplaced, aside.left_out_count],
        "fuller": [aside.with_all_contacts().left_out_count, known.with_contact(1, 1).left_out_count],
    }
    assert_baseline(f"tracking/contacts/map-{kind}", values, rtol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_free_space_and_the_first_pose(kind: Kind) -> None:
    """What free places cost around the present poses, how uncertain poses move contacts, and the first frame."""
    known, grasp = varied_map(kind), session(kind).grasps[0]
    places = known.free_points_m[None] + 0.012 * any_rows("space", 4)[:, None, : known.dimension]
    last = known.placed[-1]
    values: dict[str, Any] = {
        "costs": free_space_costs(known.fit(), places),
        "spread": placement_sigma_m(last.contacts_world, last.pose, last.covariance, known.space),
        "first": first_pose_vector(grasp, known.placed[0].contacts_world, on_table=kind != "space"),
    }
    assert_baseline(f"tracking/contacts/free-{kind}", values, rtol=3e-4)
