"""The weight of an object that only tipped, from how the table held it back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.core.fingertip import GRAVITY
from sessions.perception.carrying.net_wrench import net_wrench
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.table_pull import TablePull, table_pull, weight_on_edges
from sessions.perception.weighing.weighing import Dragging, Hanging, dragging, hanging
from tests.support.held_samples import TIPS, HEIGHT_m, JOINT_SIGMA_rad, held_samples

FRICTION, WEIGHT_N = 0.32, 4.0


def pull(carried_N, friction=FRICTION, weight_N=WEIGHT_N):
    """What the table does to an object of which the fingers carry a part; a hair too much, as of one that is free."""
    return TablePull(friction * (weight_N - carried_N) + 0.02 * max(carried_N, 0.0), carried_N)


DRAGGED, TIPPED = [pull(0.2), pull(-0.3)], [pull(2.8), pull(2.4)]


@given(st.floats(0.15, 0.6), st.floats(1.5, 8.0), st.floats(0.55, 0.9), st.floats(-0.2, 0.2))
def test_a_dragged_and_a_tipped_object_tell_its_weight(friction, weight_N, share, pressed):
    dragged = [pull(-pressed * weight_N, friction, weight_N)]
    found = weight_on_edges(dragged, [pull(share * weight_N, friction, weight_N)])
    assert found is None or abs(found.value - weight_N) < found.sigma
    if share > 0.7 and friction * weight_N > 1.0:
        assert found is not None
        assert found.value == pytest.approx(weight_N, rel=0.05)


def test_the_more_the_fingers_carry_the_surer_is_the_weight():
    little, much = (weight_on_edges(DRAGGED, [pull(share * WEIGHT_N)]) for share in (0.6, 0.9))
    assert much.sigma < 0.6 * little.sigma


def test_pulls_that_disagree_by_a_tenth_stay_within_what_is_stated():
    rng, off = np.random.default_rng(5), []
    for _ in range(200):
        dragged, tipped = ([noisy(each, rng) for each in each_kind] for each_kind in (DRAGGED, TIPPED))
        if (found := weight_on_edges(dragged, tipped)) is not None:
            off.append((found.value - WEIGHT_N) / found.sigma)
    assert len(off) > 150
    assert 0.3 < np.std(off) < 1.1


def noisy(given_pull, rng):
    return replace(given_pull, friction_N=given_pull.friction_N * rng.normal(1.0, 0.1))


@pytest.mark.parametrize(
    ("dragged", "tipped"),
    [([], TIPPED), (DRAGGED, []), (DRAGGED, [pull(1.0)]), ([TablePull(0.0, 0.0)], [pull(2.8)])],
    ids=["never dragged", "never tipped", "most of it on the table", "no friction at all"],
)
def test_what_tells_no_weight_has_none(dragged, tipped):
    assert weight_on_edges(dragged, tipped) is None


def test_friction_and_upward_force_are_means_of_both_ways():
    found = table_pull(net_wrench(held_samples(pull_N=0.7, upward_N=2.0), TIPS, "right"))
    assert found.friction_N == pytest.approx(0.7)
    assert found.carried_N == pytest.approx(2.0)


def test_what_was_not_moved_both_ways_tells_no_friction():
    samples = held_samples(pull_N=0.7, upward_N=2.0)
    still = replace(samples, world_T_forearm=np.tile(np.eye(4), (len(samples.stamps_ns), 1, 1)))
    assert table_pull(net_wrench(still, TIPS, "right")) is None


def weighed(*hangings):
    dragged = dragging(held_samples(FRICTION * WEIGHT_N, 0.0), TIPS, "right")
    return ObjectProperties(list(enumerate(hangings)), [(0, dragged)])


def hung(carried_N, friction_N):
    return hanging(held_samples(friction_N, carried_N), TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)


def test_an_object_that_only_stood_on_an_edge_has_a_mass_that_says_so_and_no_centre():
    found = weighed(hung(2.8, FRICTION * (WEIGHT_N - 2.8)))
    assert abs(found.mass_kg.value - WEIGHT_N / GRAVITY) < found.mass_kg.sigma
    assert found.mass_kg.sigma > 0.05 * found.mass_kg.value
    assert not found.hung_free
    assert found.centres == ()
    assert "mass, of what stood on an edge, 385 ± 90 g" in found.in_words()
    assert found.friction.weight_N == pytest.approx(GRAVITY * found.mass_kg.value)


def test_a_free_lift_counts_alone():
    free = hung(WEIGHT_N, 0.0)
    found = weighed(hung(2.8, 0.6), free)
    assert found.hung_free
    assert found.mass_kg.value == pytest.approx(free.weight_N / GRAVITY)
    assert "of what stood on an edge" not in found.in_words()


def test_joint_errors_of_what_hangs_free_are_none_of_an_edge_that_slips_and_catches():
    samples = held_samples(0.4, 2.8, swing=0.3)
    samples.readings[15:25] *= 0.8
    tipped = hanging(samples, TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
    as_measured = net_wrench(samples, TIPS, "right")
    assert tipped.pull == table_pull(as_measured)
    assert abs(tipped.weight_N - as_measured.force_N[:, 2].mean()) > 0.01


def test_an_edge_on_which_links_lean_hard_does_not_count():
    tipped = hung(2.8, FRICTION * (WEIGHT_N - 2.8))
    assert tipped.is_tipped
    leaned = replace(tipped, sideways_sigmas=60.0)
    assert not leaned.is_tipped
    assert weighed(leaned).mass_kg is None


def test_what_older_results_do_not_have_is_done_without():
    standing = Hanging(2.8, 0.05, np.zeros(2), np.full(2, 0.001), held_back_N=0.4)
    assert ObjectProperties([(0, standing)], [(0, Dragging(1.3, 0.1, 0.0))]).mass_kg is None
