"""The unexplored surface divided into regions that a hand can reach at once (thesis section 4.5.1, appendix B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import pdist

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.exploration.policy import Surface

Weighting = Literal["text", "appendix"]

WEIGHTINGS: dict[Weighting, tuple[float, float, float]] = {"text": (0.5, 0.4, 0.1), "appendix": (0.55, 0.3, 0.15)}
"""Of distance, normals and height: as equation 4.19 prints them, and as algorithm B.2 does."""

_MOST_POINTS = 400
_ROUNDS = 4


class RegionSettings(StrictModel):
    """How regions are made.

    Attributes:
        weighting: which of the thesis's two.
        unknown_sigma_m: vertices known worse than this are unexplored.
        scale_m: length that makes distance and height comparable with the normals' term, which has no unit.
        cut: dissimilarity at which the hierarchy is cut.
        parts: how many parts a subdivision tries.
        reach_m: regions no longer than this are not divided.
        small_quantile: organisation (algorithm B.3): regions smaller than this quantile of the sizes are small ...
        small_share: ... if they also have less than this share of the largest one.
    """

    weighting: Weighting = "text"
    unknown_sigma_m: float = Field(default=0.003, gt=0)
    scale_m: float = Field(default=0.050, gt=0)
    cut: float = Field(default=0.6, gt=0)
    parts: int = Field(default=2, ge=2)
    reach_m: float = Field(default=0.060, gt=0)
    small_quantile: float = Field(default=0.9, ge=0, le=1)
    small_share: float = Field(default=0.25, ge=0, le=1)


@dataclass(frozen=True)
class Region:
    """Vertices of the surface that belong together.

    Attributes:
        members: their indices in the surface.
        centre_m: their mean, shape (d,).
    """

    members: NDArray[np.intp]
    centre_m: Array

    @property
    def size(self) -> int:
        """Number of vertices."""
        return len(self.members)


def dissimilarity(points_m: Array, normals: Array, settings: RegionSettings) -> Array:
    """Equation 4.19 for all pairs, condensed as scipy takes it, shape (n (n - 1) / 2,).

    The thesis prints the cosine between the normals (4.17) as if it were a distance; being largest for equal normals it
    would separate what belongs together, so one minus the cosine is used. Distances (4.16) and heights (4.18) are
    divided by ``scale_m``; in the plane there is no height.
    """
    distance, turn, height = WEIGHTINGS[settings.weighting]
    total = distance * pdist(points_m) / settings.scale_m + turn * pdist(normals, "cosine")
    if points_m.shape[1] == 3:
        total += height * pdist(points_m[:, 2:]) / settings.scale_m
    return np.asarray(total)


def unexplored_regions(surface: Surface, settings: RegionSettings) -> tuple[Region, ...]:
    """Regions of the vertices whose sigma is above the limit (algorithm B.1), the largest first; none if all is known.

    At most 400 evenly chosen vertices take part; the hierarchy is of order n squared.
    """
    unknown = np.flatnonzero(surface.sigma_m > settings.unknown_sigma_m)
    if len(unknown) == 0:
        return ()
    chosen = unknown[np.linspace(0, len(unknown) - 1, min(len(unknown), _MOST_POINTS)).astype(int)]
    clusters = _link_clusters(surface, chosen, settings, cut=settings.cut)
    for _ in range(_ROUNDS):
        divided = [part for cluster in clusters for part in _subdivide(surface, cluster, settings)]
        if len(divided) == len(clusters):
            break
        clusters = divided
    regions = [_region(surface, members) for members in organise(surface.points_m, clusters, settings)]
    return tuple(sorted(regions, key=lambda region: -region.size))


def nearest_first(regions: Sequence[Region], place_m: Array) -> list[Region]:
    """Regions by the distance of their nearest-by centre to a place, usually the middle of the latest contacts."""
    return sorted(regions, key=lambda region: float(np.linalg.norm(region.centre_m - place_m)))


def organise(points_m: Array, clusters: Sequence[NDArray[np.intp]], settings: RegionSettings) -> list[NDArray[np.intp]]:
    """Algorithm B.3: small clusters join the nearest large one.

    As printed, B.3 keeps the clusters *smaller* than the quantile 0.9 and dissolves the large ones into them, which
    would leave the largest regions to crumbs; the roles are exchanged here. So that regions of like size all stay,
    a cluster is small only if it also has less than ``small_share`` of the largest one's size.
    """
    sizes = np.array([len(members) for members in clusters])
    limit = min(float(np.quantile(sizes, settings.small_quantile)), settings.small_share * sizes.max())
    kept = [members for members, size in zip(clusters, sizes, strict=True) if size >= limit]
    centres = np.array([points_m[members].mean(axis=0) for members in kept])
    for members, size in zip(clusters, sizes, strict=True):
        if size < limit:
            nearest = int(np.linalg.norm(centres - points_m[members].mean(axis=0), axis=1).argmin())
            kept[nearest] = np.concatenate([kept[nearest], members])
    return kept


def _link_clusters(
    surface: Surface, members: NDArray[np.intp], settings: RegionSettings, *, cut: float | None = None
) -> list[NDArray[np.intp]]:
    """Algorithm B.2: the hierarchy by average linkage, cut at a dissimilarity or into ``settings.parts``."""
    if len(members) < 2:
        return [members]
    tree = linkage(dissimilarity(surface.points_m[members], surface.normals[members], settings), "average")
    labels = fcluster(tree, settings.parts, "maxclust") if cut is None else fcluster(tree, cut, "distance")
    return [members[labels == label] for label in np.unique(labels)]


def _subdivide(surface: Surface, members: NDArray[np.intp], settings: RegionSettings) -> list[NDArray[np.intp]]:
    """Lines 3 to 8 of algorithm B.1: its parts, if the variance between them exceeds that of the whole (as in ANOVA).

    Mean squares of places and normals: between the parts' means, and of all about their mean. That criterion alone
    would divide without end, so what one grasp can reach stays whole, and no part is a single vertex.
    """
    parts = _link_clusters(surface, members, settings)
    extent_m = float(np.linalg.norm(np.ptp(surface.points_m[members], axis=0)))
    if len(parts) < 2 or min(map(len, parts)) < 2 or extent_m <= settings.reach_m:
        return [members]
    features = np.hstack([surface.points_m / settings.scale_m, surface.normals])
    total = _squares(features[members])
    between = (total - sum(_squares(features[part]) for part in parts)) / (len(parts) - 1)
    return parts if between > total / (len(members) - 1) else [members]


def _squares(features: Array) -> float:
    """Sum of squared distances from the mean."""
    return float(np.sum((features - features.mean(axis=0)) ** 2))


def _region(surface: Surface, members: NDArray[np.intp]) -> Region:
    return Region(members, surface.points_m[members].mean(axis=0))
