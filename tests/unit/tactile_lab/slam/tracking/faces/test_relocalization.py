"""Where the faces of a solid end, and grasps that belong elsewhere on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array, Grasp
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.solid_field import SolidField, TabulatedSolid
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.flat_faces import flat_faces
from tactile_lab.slam.tracking.faces.other_places import Outlook
from tactile_lab.slam.tracking.faces.relocalization import Relocalizer
from tactile_lab.slam.tracking.faces.solid_face_extents import solid_face_extents
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()
COUNT = 10
OUTLINE_OF_ONE = true_map("rectangle", count=1, dimension=2)


@pytest.fixture(scope="module")
def l_block() -> ContactMap:
    return true_map("l-block", count=COUNT, dimension=3)


def moved(contact_map: ContactMap, index: int, step: list[float]) -> ContactMap:
    rows = contact_map.rows
    rows[index] = contact_map.space.move(rows[index], np.array(step))
    return contact_map.with_rows(rows)


def gap_to_others(right: ContactMap, found: ContactMap, grasp: int) -> Array:
    """How much further than the last but one a grasp is from where it belongs, whichever of them the frame is of."""
    space = right.space
    offsets = space.compose(space.inverse(right.rows), found.rows)
    return space.deviation(offsets[grasp : grasp + 1], offsets[-2])[0]


def judge_of(contact_map: ContactMap) -> FacetedScorer:
    return FacetedScorer(HypothesisScorer(NOISE, 2.0), NOISE)


def rated(contact_map: ContactMap) -> Hypothesis:
    found = judge_of(contact_map).settle(contact_map)
    assert found is not None
    return found


def test_contacts_lie_before_the_ends_of_their_faces(l_block: ContactMap) -> None:
    faces, _ = flat_faces(l_block)
    ends = solid_face_extents(l_block, faces)
    beyond = ends.beyond(l_block.contacts.points_m, faces.normals, faces.offsets_m)
    assert len(beyond) > 2 * len(l_block.contacts)  # ridges on both sides and above
    assert beyond.max() < 3
    assert np.any(ends.strengths < 0)  # the notch
    assert np.median(beyond) < -5


def test_ends_hold_what_would_slide_off(l_block: ContactMap) -> None:
    faces, _ = flat_faces(l_block)
    ends = solid_face_extents(l_block, faces)
    beyond, off_m = [], []
    for given in (None, ends):
        found = FacetSmoother(l_block, NOISE, given).fit(moved(l_block, 7, [0.03, 0.0, 0.0]).rows, faces, 30)
        points = l_block.with_rows(found.rows).contacts.points_m
        beyond.append(ends.beyond(points, found.faces.normals, found.faces.offsets_m).max())
        off_m.append(np.linalg.norm(found.rows[:, :2] - l_block.rows[:, :2], axis=1).max())
    assert beyond[0] > 3 > 1 > beyond[1]
    assert off_m[1] < off_m[0] + 0.001


def test_smoothing_between_ends_takes_the_steepest_way(l_block: ContactMap) -> None:
    """Derivatives that were wrong would make the optimiser stop early or not at all."""
    faces, _ = flat_faces(l_block)
    ends = solid_face_extents(l_block, faces)
    smoother = FacetSmoother(l_block, NOISE, ends)
    loose = FacetSmoother(l_block, NOISE).fit(l_block.rows, faces, 30)
    settled = smoother.fit(loose.rows, loose.faces, 6)
    assert settled.cost == pytest.approx(smoother.fit(loose.rows, loose.faces, 60).cost, abs=0.05)


def test_the_distance_from_a_solid_is_signed(l_block: ContactMap) -> None:
    mesh = Polyhedron.fit(l_block.fit(), l_block.free_points_m).mesh(0.006)
    field = SolidField(mesh, 0.001)
    centre, outside = mesh.vertices.mean(axis=0), mesh.vertices.max(axis=0) + np.array([0.0, 0.0, 0.01])
    found = field.predict(np.vstack([l_block.contacts.points_m, centre, outside]), gradient=True, variance=True)
    assert np.median(np.abs(found.mean_m[:-2])) < 0.002
    assert found.mean_m[-1] > 0.009
    assert np.median(np.einsum("nd,nd->n", found.gradient[:-2], l_block.contacts.normals)) > 0.95
    assert found.variance_m2 == pytest.approx(1e-6)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_tabulated_solid_is_like_the_solid(l_block: ContactMap, scale: float) -> None:
    given = Polyhedron.fit(l_block.fit(), l_block.free_points_m).mesh(0.006)
    mesh = replace(given, vertices=scale * given.vertices)
    exact, tabulated = SolidField(mesh, 0.001), TabulatedSolid(mesh, 0.001)
    spread = np.random.default_rng(0).normal(0.0, 0.008 * scale, l_block.contacts.points_m.shape)
    places = scale * l_block.contacts.points_m + spread
    one, other = (field.predict(places, gradient=True, variance=True) for field in (exact, tabulated))
    assert np.abs(one.mean_m - other.mean_m).max() < 0.001 * scale
    assert np.mean(np.abs(one.mean_m - other.mean_m) < 1e-4 * scale) > 0.8
    assert np.median(np.sum(one.gradient * other.gradient, axis=1)) > 0.99
    assert np.array_equal(one.variance_m2, other.variance_m2)


@pytest.mark.parametrize("grasp", [0, 9])
def test_a_grasp_that_closed_on_the_wrong_faces_is_found_its_place(l_block: ContactMap, grasp: int) -> None:
    """The first one, too, at which the object frame was born."""
    wrong = rated(moved(l_block, grasp, [0.012, -0.02, np.deg2rad(90.0)]))
    right = rated(l_block)
    found = Relocalizer(judge_of(l_block), NOISE, ProposalSettings()).improve(wrong)
    assert wrong.cost > right.cost + 5
    assert found.cost < wrong.cost - 5
    gap = gap_to_others(l_block, found.map, grasp)
    assert np.linalg.norm(gap[:2]) < 0.006
    assert abs(gap[2]) < 0.15


def test_a_grasp_with_wrong_contacts_is_found_its_place_without_them(l_block: ContactMap) -> None:
    """Two of five contacts fit nothing where the grasp belongs; where it is, one of them lies on a face by chance."""
    grasp = l_block.placed[9]
    points_m = grasp.contacts_world.points_m.copy()
    points_m[:2] += [[0.03, 0.02, 0.01], [-0.025, 0.03, -0.01]]
    spoilt = l_block.with_placed(9, replace(grasp, contacts_world=replace(grasp.contacts_world, points_m=points_m)))
    elsewhere = moved(spoilt, 9, [0.012, -0.02, np.deg2rad(90.0)]).without_contact(9, 0)
    found = Relocalizer(judge_of(l_block), NOISE, ProposalSettings()).improve(rated(elsewhere))
    assert {0, 1} <= found.map.placed[9].left_out
    assert np.linalg.norm(found.map.rows[9, :2] - l_block.rows[9, :2]) < 0.006


@pytest.mark.long  # quicker: a single grasp on wrong faces, above
def test_grasps_that_took_a_wrong_turn_together_are_turned_back_together() -> None:
    """A third of a turn of a prism with three equal sides: only the motion tells, and only at both ends of the run."""
    prism = true_map("triangular-prism", count=COUNT, dimension=3)
    turned = prism
    for index in (5, 6, 7, 8):
        turned = moved(turned, index, [0.0, 0.0, 2 * np.pi / 3])
    wrong, right = rated(turned), rated(prism)
    found = Relocalizer(judge_of(prism), NOISE, ProposalSettings()).improve(wrong)
    assert wrong.cost > right.cost + 5
    assert found.cost < right.cost + 0.5
    gaps = prism.space.deviation(found.map.rows[5:9], right.map.rows[5:9])
    assert np.abs(gaps[:, 2]).max() < 0.15


class Noting(FacetedScorer):
    """Notes the maps that it is asked to settle, and finds no faces in any."""

    def __init__(self) -> None:
        super().__init__(HypothesisScorer(NOISE, 2.0), NOISE)
        self.asked: list[ContactMap] = []

    def settle(self, contact_map: ContactMap) -> Hypothesis | None:
        self.asked.append(contact_map)
        return None


def test_a_wrong_turn_is_followed_up_to_a_grasp_that_touched_nothing() -> None:
    """The grasps before it are tried together at their places, and it stays, as do those after it."""
    prism = true_map("triangular-prism", count=8, dimension=3)
    turned = prism
    for index in (3, 4):
        turned = moved(turned, index, [0.0, 0.0, 2 * np.pi / 3])
    missed = ContactSet.of_grasp(Grasp(5, 0, ()), 3, 0.0)
    turned = turned.with_placed(5, replace(turned.placed[5], contacts_world=missed))
    sharp = Noting()
    best = HypothesisScorer(NOISE, 2.0).score(turned)
    assert Relocalizer(sharp, NOISE, ProposalSettings()).improve(best) is best
    changed = [np.flatnonzero(np.any(each.rows != turned.rows, axis=1)).tolist() for each in sharp.asked]
    assert [3, 4] in changed
    together = sharp.asked[changed.index([3, 4])]
    gaps = prism.space.deviation(together.rows[3:5], prism.rows[3:5])
    assert np.abs(gaps[:, 2]).max() < 0.2


def test_what_is_round_has_no_other_places() -> None:
    contact_map = true_map("ellipsoid", count=12, dimension=3)
    smooth = HypothesisScorer(NOISE, 2.0).score(contact_map)
    assert Relocalizer(judge_of(contact_map), NOISE, ProposalSettings()).improve(smooth) is smooth


@pytest.fixture(scope="module")
def outline() -> ContactMap:
    return true_map("rectangle", count=COUNT, dimension=2)


@pytest.mark.parametrize("grasp", [0, 7])
def test_a_grasp_whose_contacts_fit_badly_is_found_its_place_on_an_outline(outline: ContactMap, grasp: int) -> None:
    """Driven onto the others' field: two of its contacts are left out where it is, none where it belongs."""
    elsewhere = moved(outline, grasp, [0.02, -0.015, np.deg2rad(60.0)])
    wrong = judge_of(outline).better(elsewhere.without_contact(grasp, 0).without_contact(grasp, 1))
    found = Relocalizer(judge_of(outline), NOISE, ProposalSettings()).improve(wrong)
    assert found.cost < wrong.cost - 10
    gap = gap_to_others(outline, found.map, grasp)
    assert np.linalg.norm(gap[:2]) < 0.006
    assert abs(gap[2]) < 0.15
    assert not found.map.placed[grasp].left_out


def test_a_grasp_alone_has_no_other_place(outline: ContactMap) -> None:
    """One grasp is all there is, or all whose contacts are used: there is nothing else to drive it onto."""
    alone = judge_of(OUTLINE_OF_ONE).better(OUTLINE_OF_ONE)
    assert Relocalizer(judge_of(OUTLINE_OF_ONE), NOISE, ProposalSettings()).improve(alone) is alone
    only = outline
    for index in range(1, COUNT):
        for contact in range(len(outline.placed[index].contacts_world)):
            only = only.without_contact(index, contact)
    kept = judge_of(outline).better(only)
    assert Relocalizer(judge_of(outline), NOISE, ProposalSettings()).improve(kept).cost <= kept.cost


def test_grasps_that_fit_an_outline_stay(outline: ContactMap) -> None:
    right = judge_of(outline).better(outline)
    assert Relocalizer(judge_of(outline), NOISE, ProposalSettings()).improve(right) is right


def test_a_grasp_that_slid_off_the_end_of_a_face_is_found_its_place(outline: ContactMap) -> None:
    """All contacts of grasp 2 are on two parallel faces, along which nothing but its slips holds it."""
    judge, rows = judge_of(outline), outline.rows
    rows[2] = outline.space.compose(rows[2], np.array([-0.03, 0.0, 0.0]))
    slid = HypothesisScorer(NOISE, 2.0).score(outline.with_rows(rows))
    assert judge.strayed(outline) == frozenset()
    assert judge.strayed(slid.map) == {2}
    found = Relocalizer(judge, NOISE, ProposalSettings()).improve(slid)
    assert found.cost < slid.cost - 10
    assert judge.strayed(found.map) == frozenset()


def test_first_grasps_that_took_a_wrong_turn_together_are_led_back_from_the_next(l_block: ContactMap) -> None:
    """Each alone would pay for two slips, at either side of it; together they pay for one less."""
    space, rows = l_block.space, l_block.rows
    turn = np.array([0.012, -0.02, np.deg2rad(90.0)])
    rows[:2] = space.compose(rows[:2], np.broadcast_to(turn, (2, 3)))
    turned = l_block.with_rows(rows)
    solid = TabulatedSolid(judge_of(l_block).solid(rated(l_block)), 0.0005)
    onto = dict.fromkeys(range(COUNT), solid)
    places = Outlook(turned, onto, NOISE, ProposalSettings().model_copy(update={"samples": 48})).all_places()
    (first, *_) = sorted((place for place in places if len(place.rows) == 2), key=lambda place: place.change)
    assert first.index == 0
    assert first.change < -5
    gaps = space.deviation(first.rows, l_block.rows[:2])
    assert np.abs(gaps[:, :2]).max() < 0.010
    assert np.abs(gaps[:, 2]).max() < 0.15


def test_a_place_that_comes_close_is_judged_with_other_contacts_left_out(l_block: ContactMap) -> None:
    """A contact that is right has a face of its own while its grasp is elsewhere, and is left out when it is moved."""

    class Judge(FacetedScorer):
        asked = 0

        def reconsidered(self, sharp: Hypothesis) -> Hypothesis:
            self.asked += 1
            return replace(super().reconsidered(sharp), misfit=sharp.misfit - 9.0)

    judge, right = Judge(HypothesisScorer(NOISE, 2.0), NOISE), rated(l_block)
    near = replace(right, misfit=right.misfit + 5.0)
    far = replace(right, misfit=right.misfit + 50.0)
    relocalizer = Relocalizer(judge, NOISE, ProposalSettings())
    found = relocalizer._reconsidered([near, far], right)
    assert judge.asked == 1
    assert found[0].cost == pytest.approx(right.cost - 4.0)
    assert found[1] is far
