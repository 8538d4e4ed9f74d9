"""What viewers show, logged to Rerun: as a file, or into a running viewer.

Frames are entities below one another, from ``world`` on, so that whatever is logged at a link moves with it. The
timeline is ``session``, in seconds of the session's clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from gtsam import Pose3, Rot3

from tactile_lab.viewers.items import (
    Candidates,
    Frames,
    Item,
    Joints,
    Lens,
    Loads,
    ObjectPose,
    Picture,
    Remark,
    SensorWrench,
    Surface,
    Touches,
)
from tactile_lab.viewers.parts import BoxPart, CapsulePart, EllipsoidPart, Part
from tactile_lab.viewers.robot import CAMERA, OBJECT, TABLE, WORLD, Placement, Robot, table_part

TIMELINE = "session"
_FORCE_SCALE_m_N, _CANDIDATE_m, _SIGMAS = 0.025, 0.03, 2.0
_EYE_m, _LOOKED_AT_m = (0.30, -0.33, 0.24), (-0.02, 0.0, 0.09)
"""Where the scene is seen from at first, world frame."""
_HAND, _TIP, _PLATE = (120, 128, 138), (92, 112, 143), (219, 224, 230)
_CONTACT, _CANDIDATE, _CHOSEN = (230, 76, 26), (115, 115, 128), (214, 90, 160)
_LEVELS = {2: "INFO", 3: "WARN", 4: "ERROR"}
_SOLID = "solid"


class RerunLog:
    """Logs items of one session.

    Args:
        stream: Rerun's, with a sink already.
        robot: of the session.
    """

    def __init__(self, stream: rr.RecordingStream, robot: Robot) -> None:
        self._stream, self._robot = stream, robot
        self._paths: dict[str, str] = {WORLD: WORLD}
        self._makers: Mapping[type, Callable[[Any], None]] = {
            Frames: self._frames,
            Joints: self._joints,
            Loads: self._loads,
            SensorWrench: self._wrench,
            Touches: self._touches,
            Surface: self._surface,
            ObjectPose: self._object,
            Candidates: self._candidates,
            Picture: self._picture,
            Lens: self._lens,
            Remark: self._remark,
        }

    def log(self, items: Iterable[Item]) -> int:
        """Everything; returns the number of items."""
        self._begin()
        count = 0
        for item in items:
            self._stream.set_time(TIMELINE, duration=np.timedelta64(item.stamp_ns, "ns"))
            self._makers[type(item)](item)
            count += 1
        return count

    def _begin(self) -> None:
        """What never changes: the links' shapes, names of curves."""
        for joint in self._robot.joints:
            self._paths[joint.child] = f"{self._paths[joint.parent]}/{joint.child}"
        self._stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for link, parts in {TABLE: (table_part(self._robot),), **self._robot.parts}.items():
            for number, part in enumerate(parts):
                colour = _PLATE if link == TABLE else _TIP if link.endswith("distal") else _HAND
                self._stream.log(f"{self._paths[link]}/shape_{number}", _solid(part, colour), static=True)
        names = [joint.name for joint in self._robot.joints if joint.kind != "fixed"]
        self._stream.log("joints", rr.SeriesLines(names=names), static=True)

    def _path(self, placement: Placement) -> str:
        path = f"{self._paths[placement.parent]}/{placement.child}"
        self._paths.setdefault(placement.child, path)
        return path

    def _frames(self, item: Frames) -> None:
        for placement in item.placements:
            pose = placement.parent_T_child
            transform = rr.Transform3D(translation=pose.translation(), quaternion=_xyzw(pose))
            self._stream.log(self._path(placement), transform, static=item.lasting)

    def _joints(self, item: Joints) -> None:
        self._stream.log("joints", rr.Scalars(list(item.positions.values())))

    def _loads(self, item: Loads) -> None:
        for finger, load_N in item.load_N.items():
            if load_N is not None:
                self._stream.log(f"load_N/{finger}", rr.Scalars(load_N))

    def _wrench(self, item: SensorWrench) -> None:
        self._stream.log(f"wrench/{item.finger}/force_N", rr.Scalars(item.force_N))
        self._stream.log(f"wrench/{item.finger}/torque_Nm", rr.Scalars(item.torque_Nm))

    def _touches(self, item: Touches) -> None:
        for number in item.gone:
            self._stream.log(f"{WORLD}/contacts/grasp_{number}", rr.Clear(recursive=True))
        here, points_m = f"{WORLD}/contacts/grasp_{item.grasp}", item.points_world_m
        names = [one.finger for one in item.touches]
        self._stream.log(
            f"{here}/points", rr.Points3D(points_m, radii=0.0015, colors=[_CONTACT], labels=names, show_labels=False)
        )
        turns, sizes_m = _ellipsoids([one.covariance_m2 for one in item.touches])
        self._stream.log(
            f"{here}/uncertainty",
            rr.Ellipsoids3D(half_sizes=sizes_m, centers=points_m, quaternions=turns, colors=[_CONTACT]),
        )
        vectors_m = _FORCE_SCALE_m_N * item.forces_N[:, None] * item.normals_world
        self._stream.log(
            f"{WORLD}/forces", rr.Arrows3D(origins=points_m + vectors_m, vectors=-vectors_m, colors=[_CONTACT])
        )

    def _surface(self, item: Surface) -> None:
        path = f"{self._object_path}/surface"
        if not len(item.vertices_m):
            self._stream.log(path, rr.Clear(recursive=True))
            return
        mesh = rr.Mesh3D(vertex_positions=item.vertices_m, triangle_indices=item.triangles, vertex_colors=item.colours)
        self._stream.log(path, mesh)
        self._stream.log("explored", rr.Scalars(item.explored))

    @property
    def _object_path(self) -> str:
        return self._paths.get(OBJECT, f"{WORLD}/{OBJECT}")

    def _object(self, item: ObjectPose) -> None:
        """The pose itself is a frame; this is how well it is known."""
        if item.covariance is not None and not item.true:
            turns, sizes_m = _ellipsoids([item.covariance[:3, :3]])
            centre_m = [item.world_T_object.translation()]
            ellipsoid = rr.Ellipsoids3D(half_sizes=sizes_m, centers=centre_m, quaternions=turns)
            self._stream.log(f"{WORLD}/pose_uncertainty", ellipsoid)
            self._stream.log("yaw_sigma_rad", rr.Scalars(float(np.sqrt(item.covariance[5, 5]))))

    def _candidates(self, item: Candidates) -> None:
        poses = [one.world_T_grasp for one in item.candidates]
        colours = [_CHOSEN if one.chosen else _CANDIDATE for one in item.candidates]
        labels = ["" if one.score is None else f"{one.score:.3g}" for one in item.candidates]
        arrows = rr.Arrows3D(
            origins=[pose.translation() for pose in poses],
            vectors=[_CANDIDATE_m * pose.rotation().matrix()[:, 0] for pose in poses],
            colors=colours,
            labels=labels,
            show_labels=False,
        )
        self._stream.log(f"{WORLD}/candidates", arrows)
        self._stream.log("log", rr.TextLog(item.text, level="INFO"))

    def _picture(self, item: Picture) -> None:
        image = rr.EncodedImage(contents=item.encoded, media_type=f"image/{item.kind}")
        self._stream.log(f"{WORLD}/{CAMERA}/image", image)

    def _lens(self, item: Lens) -> None:
        pinhole = rr.Pinhole(image_from_camera=item.matrix, resolution=item.size_px, image_plane_distance=0.1)
        self._stream.log(f"{WORLD}/{CAMERA}/image", pinhole)

    def _remark(self, item: Remark) -> None:
        text = rr.TextLog(f"{item.source}: {item.text}", level=_LEVELS.get(item.level, "INFO"))
        self._stream.log("log", text)


def blueprint() -> rrb.Blueprint:
    """The views that are open at first: the scene, loads, the camera, the log."""
    eye = rrb.EyeControls3D(position=_EYE_m, look_target=_LOOKED_AT_m, eye_up=(0.0, 0.0, 1.0))
    scene = rrb.Spatial3DView(origin=WORLD, name="hand and object", eye_controls=eye)
    side = rrb.Vertical(
        rrb.TimeSeriesView(origin="load_N", name="load on the fingertips [N]"),
        rrb.Spatial2DView(origin=f"{WORLD}/{CAMERA}/image", name="camera"),
        rrb.TextLogView(origin="log", name="log"),
    )
    return rrb.Blueprint(rrb.Horizontal(scene, side, column_shares=[2, 1]), collapse_panels=True)


def _solid(part: Part, colour: tuple[int, int, int]) -> Any:
    place = part.link_T_part
    if isinstance(part, CapsulePart):  # Rerun's begin in the middle of their first end
        place = place * Pose3(Rot3(), np.array([0.0, 0.0, -part.length_m / 2]))
        where = {"translations": [place.translation()], "quaternions": [_xyzw(place)], "colors": [colour]}
        return rr.Capsules3D(lengths=[part.length_m], radii=[part.radius_m], fill_mode=_SOLID, **where)
    where = {"centers": [place.translation()], "quaternions": [_xyzw(place)], "colors": [colour]}
    if isinstance(part, BoxPart):
        return rr.Boxes3D(sizes=[part.size_m], fill_mode=_SOLID, **where)
    assert isinstance(part, EllipsoidPart)
    return rr.Ellipsoids3D(half_sizes=[part.semi_axes_m], fill_mode=_SOLID, **where)


def _ellipsoids(covariances: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Quaternions and semi-axes of two standard deviations for each covariance, shape (3, 3)."""
    turns, sizes = [], []
    for covariance in covariances:
        variances, axes = np.linalg.eigh(covariance)
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] *= -1.0
        turns.append(_xyzw(Pose3(Rot3(axes), np.zeros(3))))
        sizes.append(_SIGMAS * np.sqrt(np.maximum(variances, 0.0)))
    return turns, sizes


def _xyzw(pose: Pose3) -> Any:
    turn: Any = pose.rotation().toQuaternion()
    return rr.Quaternion(xyzw=[turn.x(), turn.y(), turn.z(), turn.w()])
