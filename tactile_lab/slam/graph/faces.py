"""Which face of the object each contact lies on (thesis section 3.3.3.1 and appendix A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.level_sets import without_small_bends
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

Labels = NDArray[np.int64]

NO_FACE = -1


class FaceSettings(StrictModel):
    """How contacts are divided into faces; the thesis does not give these values.

    Attributes:
        tolerance_m: largest distance of the contour from its polygon (Douglas-Peucker).
        shortest_segment_m: shorter segments are rounded corners, not faces.
        largest_distance_m: contacts farther from every segment belong to none.
        normal_angle_rad: largest angle between a contact's normal and its face's.
        neighbours: in space, each contact is linked to this many nearest ones for the paths of appendix A.
    """

    tolerance_m: float = Field(default=0.004, gt=0)
    shortest_segment_m: float = Field(default=0.008, gt=0)
    largest_distance_m: float = Field(default=0.010, gt=0)
    normal_angle_rad: float = Field(default=float(np.deg2rad(30.0)), gt=0)
    neighbours: int = Field(default=5, ge=1)


@dataclass(frozen=True)
class Segments:
    """Straight pieces of a contour.

    Attributes:
        starts_m, ends_m: end points, shape (n, 2).
        normals: outward unit normals, shape (n, 2).
    """

    starts_m: Array
    ends_m: Array
    normals: Array


def contour_segments(contour_m: Array, settings: FaceSettings) -> Segments:
    """A contour, shape (n, 2), counter-clockwise, its last point joined to the first, divided into faces.

    Douglas-Peucker needs a point to start from: the one farthest from the centre, most likely a corner.
    """
    corner = int(np.argmax(np.sum((contour_m - contour_m.mean(axis=0)) ** 2, axis=1)))
    ring = np.roll(contour_m, -corner, axis=0)
    polygon = without_small_bends(np.vstack([ring, ring[:1]]), settings.tolerance_m)
    starts, ends = polygon[:-1], polygon[1:]
    along = ends - starts
    lengths = np.linalg.norm(along, axis=1)
    keep = lengths >= settings.shortest_segment_m
    right = np.column_stack([along[:, 1], -along[:, 0]])[keep] / lengths[keep, None]
    return Segments(starts[keep], ends[keep], right)


def assign_to_segments(contacts: ContactSet, segments: Segments, settings: FaceSettings) -> Labels:
    """The nearest segment with a fitting normal for each contact (object frame, plane), or :data:`NO_FACE`."""
    if len(segments.starts_m) == 0:
        return np.full(len(contacts), NO_FACE)
    along = segments.ends_m - segments.starts_m
    gap = contacts.points_m[:, None] - segments.starts_m
    share = np.clip(np.sum(gap * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
    distances = np.linalg.norm(gap - share[..., None] * along, axis=2)
    fitting = contacts.normals @ segments.normals.T > np.cos(settings.normal_angle_rad)
    distances = np.where(fitting, distances, np.inf)
    nearest = distances.argmin(axis=1)
    return np.where(distances.min(axis=1) <= settings.largest_distance_m, nearest, NO_FACE)


def cluster_by_normals(normals: Array, largest_angle_rad: float) -> Labels:
    """Appendix A, step 1: contacts of similar normals share a cluster, in order of arrival.

    A contact joins the cluster with the most similar mean normal if that is similar enough, else it opens
    a new one. (Printed, it joins at the first similar member, which lets clusters creep around a curve.)
    """
    sums: list[Array] = []
    labels = np.empty(len(normals), dtype=np.int64)
    for index, normal in enumerate(normals):
        cosines = [float(normal @ total) / float(np.linalg.norm(total)) for total in sums]
        best = int(np.argmax(cosines)) if cosines else -1
        if best >= 0 and cosines[best] > np.cos(largest_angle_rad):
            sums[best] = sums[best] + normal
        else:
            best = len(sums)
            sums.append(normal)
        labels[index] = best
    return labels


def split_by_paths(points_m: Array, labels: Labels, neighbours: int) -> Labels:
    """Appendix A, step 2: a cluster is divided where the path between two of its contacts leaves it.

    Paths are shortest ones (Dijkstra) over a graph that links every contact to its nearest ones; a path that
    needs a contact of another cluster shows that another face lies between. Contacts that reach each other
    without leaving stay together.
    """
    predecessors = _shortest_path_predecessors(points_m, neighbours)
    split = np.empty_like(labels)
    count = 0
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        joined = [[_stays_inside(predecessors, a, b, labels) for b in members.tolist()] for a in members.tolist()]
        pieces, piece_of = connected_components(csr_array(np.array(joined, dtype=float)), directed=False)
        split[members] = count + piece_of
        count += int(pieces)
    return split


def _shortest_path_predecessors(points_m: Array, neighbours: int) -> NDArray[np.int32]:
    count = len(points_m)
    near = min(neighbours + 1, count)
    distances, indices = cKDTree(points_m).query(points_m, k=near)
    rows = np.repeat(np.arange(count), near)
    lengths = np.maximum(np.ravel(distances), 1e-9)
    graph = csr_array((lengths, (rows, np.ravel(indices))), shape=(count, count))
    _, predecessors = dijkstra(graph, directed=False, return_predecessors=True)
    return np.asarray(predecessors)


def _stays_inside(predecessors: NDArray[np.int32], start: int, goal: int, labels: Labels) -> bool:
    """The path from start to goal exists and meets contacts of one cluster only."""
    at = goal
    while at != start:
        at = int(predecessors[start, at])
        if at < 0 or labels[at] != labels[start]:
            return False
    return True


def surface_faces(contacts: ContactSet, settings: FaceSettings) -> Labels:
    """Faces of a solid from its contacts alone (algorithm A.1), for contacts in space, object frame."""
    by_normal = cluster_by_normals(contacts.normals, settings.normal_angle_rad)
    return split_by_paths(contacts.points_m, by_normal, settings.neighbours)
