"""The registration baseline: each grasp's contacts are matched to those placed before, starting at odometry.

Generalised ICP by small-gicp knows points with a local plane. A contact has its plane from its normal, not from its
neighbours, so it is passed as a small disc of points; the library does the rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gtsam import Pose3
from pydantic import Field as Limit

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.tracking.baselines.odometry_tracker import OdometryTracker
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.filter.particle_filter import PoseEstimate

_DISC_POINTS = 12  # with fewer the library complains on the terminal of a lone contact
_DISC_RADIUS_m = 0.0015
_ROTATION_STEP_rad, _TRANSLATION_STEP_m = 1e-5, 1e-6

_PLANE_VARIANCE = 1e-3
"""small-gicp gives every point this variance along its normal, in no unit; two partners have it twice."""


class IcpSettings(StrictModel):
    """Parameters of the registration baseline.

    Attributes:
        reach_m: contacts farther from the map than this are not matched.
        believed: a pose farther from odometry than this many standard deviations is rejected.
        iterations: largest number per grasp.
        least_matched: share of a grasp's contacts that must find a partner; otherwise odometry is used.
    """

    reach_m: float = Limit(default=0.030, gt=0)
    believed: float = Limit(default=3.0, gt=0)
    iterations: int = Limit(default=60, ge=1)
    least_matched: float = Limit(default=0.5, ge=0, le=1)


class IcpTracker(OdometryTracker):
    """Odometry, corrected by registration to the contacts placed so far."""

    def __init__(self, first: ContactMap, noise: MotionNoise, settings: IcpSettings) -> None:
        super().__init__(first, noise)
        self._settings = settings

    def weigh(self, contacts: ContactSet) -> bool:
        """Register the contacts. Returns False if too few find a partner, and the predicted pose is used."""
        found = self._register(contacts) if len(contacts) else None
        self._trusted = found is not None and self._believable(found[0])
        if found is not None and self._trusted:
            self._now = PoseEstimate(found[0], self._covariance_at(*found, contacts))
        return self._trusted

    def _believable(self, row: Array) -> bool:
        away = self._map.space.deviation(row, self._now.pose)
        return bool(away @ np.linalg.solve(self._now.covariance, away) < len(row) * self._settings.believed**2)

    def _register(self, contacts: ContactSet) -> tuple[Array, float] | None:
        """The pose that fits the contacts to the map, and their mean squared distance from it, or None."""
        import small_gicp  # here: only this baseline needs it

        target, tree = _cloud(self._map.contacts)
        source, _ = _cloud(contacts)
        start = self._map.space.pose(self._now.pose, 0.0)
        found = small_gicp.align(
            target,
            source,
            tree,
            init_T_target_source=start.inverse().matrix(),
            registration_type="GICP",
            max_correspondence_distance=self._settings.reach_m,
            num_threads=1,
            max_iterations=self._settings.iterations,
            rotation_epsilon=_ROTATION_STEP_rad,
            translation_epsilon=_TRANSLATION_STEP_m,
        )
        object_T_world = np.asarray(found.T_target_source)
        enough = found.num_inliers >= self._settings.least_matched * source.size()
        if not enough or not np.isfinite(object_T_world).all():
            return None
        squared_m2 = 2 * found.error * 2 * _PLANE_VARIANCE / found.num_inliers
        return self._map.space.motion(Pose3(object_T_world).inverse()), squared_m2

    def _covariance_at(self, row: Array, squared_m2: float, contacts: ContactSet) -> Array:
        """Information of the distances along the normals to equally uncertain partners, and odometry for the rest.

        Contacts farther from their partners than their noise explains are weighted down accordingly.
        """
        space = self._map.space
        points, normals = space.to_object(row, contacts.points_m, contacts.normals)
        along = space.by_row(row, points, normals, normals, np.zeros_like(normals))
        told = along / np.sqrt(np.maximum(2 * contacts.point_sigma_m**2, squared_m2))[:, None]
        return np.asarray(np.linalg.inv(told.T @ told + np.linalg.inv(self._now.covariance)))


def _cloud(contacts: ContactSet) -> tuple[Any, Any]:
    """A small-gicp point cloud with the contacts' planes, and its search tree."""
    import small_gicp

    cloud = small_gicp.PointCloud(_discs(contacts))
    tree = small_gicp.KdTree(cloud)
    small_gicp.estimate_normals_covariances(cloud, tree, _DISC_POINTS + 1)
    return cloud, tree


def _discs(contacts: ContactSet) -> Array:
    """Each contact with points around it in its tangent plane, shape (13 n, 3)."""
    missing = ((0, 0), (0, 3 - contacts.dimension))
    points, normals = np.pad(contacts.points_m, missing), np.pad(contacts.normals, missing)
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    angles = np.linspace(0.0, 2 * np.pi, _DISC_POINTS, endpoint=False)[:, None, None]
    ring = _DISC_RADIUS_m * (np.cos(angles) * first + np.sin(angles) * second)
    return np.concatenate([points[None], points + ring]).reshape(-1, 3)
