"""Contacts on the upright walls of an object on a table, seen from above: an outline, at the same poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tactile_lab.slam.shape.solids.prism import on_walls
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet


def walls_from_above(contact_map: ContactMap) -> ContactMap:
    """The contacts on upright walls, in the plane, with the best kernel for them.

    Args:
        contact_map: of an object on a table, contacts in space; its grasps remain, some perhaps without contacts.
    """
    placed = tuple(_project_down(grasp) for grasp in contact_map.placed)
    return replace(contact_map, placed=placed).with_best_kernel()


def _project_down(grasp: PlacedGrasp) -> PlacedGrasp:
    kept = grasp.kept_world
    walls = kept.select(on_walls(kept.normals))
    level = walls.normals[:, :2] / np.linalg.norm(walls.normals[:, :2], axis=1, keepdims=True)
    given = walls.points_m[:, :2], level, walls.point_sigma_m, walls.normal_sigma_rad, np.empty((0, 2))
    flat = ContactSet(*given, shared=walls.shared)
    return replace(grasp, contacts_world=flat, left_out=frozenset())
