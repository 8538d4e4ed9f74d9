"""Recorded observations of a forearm-to-world calibration in a file, so that it can be solved again.

This program's format (``tactile-forearm-data/1``) is one JSON document with touches or views and all data needed to
solve them. Pose pairs as other programs write them, ``[[mount_T_hand, camera_T_target], ...]`` with 4 x 4 matrices, are
read too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from gtsam import Pose3
from pydantic import AfterValidator, Field, RootModel

from calibration.forearm.pose_streams import STREAMS_FORMAT, Matrix, PoseStreams, read_streams, rigid_pose
from calibration.steps.observations import HandPose, Plane, PosePair, Spot, Target, Touch, View
from drivers.camera.calibration import CameraCalibration
from drivers.camera.markers import MarkerSettings
from drivers.core.atomic_files import write_whole
from drivers.core.configuration import StrictModel, validate
from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import RigidTransform, Vector3
from drivers.core.reading.bounded_files import LARGEST_JSON_bytes, read_input
from drivers.core.reading.json_text import parse_json
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINTS
from drivers.shadow.model.motors import DRIVEN_JOINTS
from drivers.shadow.protocol.palm_images import Side

FORMAT = "tactile-forearm-data/1"

Six = tuple[float, float, float, float, float, float]
Joints = Annotated[tuple[float, ...], Field(min_length=len(JOINTS), max_length=len(JOINTS))]
Square3 = tuple[Vector3, Vector3, Vector3]
Pixel = tuple[float, float]


def _driven_joint(name: str) -> str:
    if name not in DRIVEN_JOINTS:
        raise ValueError(f"no motor drives {name}; driven joints are {', '.join(DRIVEN_JOINTS)}")
    return name


class PlaneEntry(StrictModel):
    """A face."""

    kind: Literal["plane"] = "plane"
    name: str
    point_world_m: Vector3
    normal_world: Vector3
    sigma_m: float = Field(ge=0.0)


class SpotEntry(StrictModel):
    """A known point."""

    kind: Literal["spot"] = "spot"
    name: str
    point_world_m: Vector3
    sigma_m: float = Field(ge=0.0)


class TouchEntry(StrictModel):
    """One touch."""

    finger: Literal["FF", "MF", "RF", "LF", "TH"]
    base_q: Six
    joints_rad: Joints
    point_distal_m: Vector3
    normal_distal: Vector3
    point_covariance_m2: Square3
    force_N: float = 0.0
    target: Annotated[PlaneEntry | SpotEntry, Field(discriminator="kind")]


class ViewEntry(StrictModel):
    """One picture."""

    base_q: Six
    joints_rad: Joints
    board_m: tuple[Vector3, ...]
    board_px: tuple[Pixel, ...]
    world_px: tuple[Pixel, Pixel, Pixel, Pixel] | None = None


class DataFile(StrictModel):
    """A file of recorded observations."""

    format: Literal["tactile-forearm-data/1"] = "tactile-forearm-data/1"
    rig: str = Field(min_length=1)
    devices: dict[str, str] = Field(default_factory=dict)
    side: Side = "right"
    driven: tuple[Annotated[str, AfterValidator(_driven_joint)], ...] = DRIVEN_JOINTS
    guess: RigidTransform = RigidTransform(translation_m=(0.0, 0.0, 0.0))
    touches: tuple[TouchEntry, ...] = ()
    views: tuple[ViewEntry, ...] = ()
    link: Literal["palm", "FF", "MF", "RF", "LF", "TH"] = "palm"
    camera: CameraCalibration | None = None
    markers: MarkerSettings | None = None


class _Pairs(RootModel[tuple[tuple[Matrix, Matrix], ...]]):
    """Pose pairs as other programs write them."""


@dataclass(frozen=True, eq=False)
class ForearmData:
    """Recorded observations: touches, views or pairs, and what solving them needs.

    Attributes:
        rig, devices: what they were recorded on; empty if unknown.
        form: of the hand.
        guess: approximate pose of the mount.
        touches, views, pairs, streams: one of them; pairs too for streams, at the offset that their motion suggests.
        link: what carries the board in the views.
        camera, markers: lens and world marker of the views.
    """

    rig: str = ""
    devices: dict[str, str] = field(default_factory=dict)
    form: HandForm = RIGHT_HAND
    guess: Pose3 = field(default_factory=Pose3)
    touches: tuple[Touch, ...] = ()
    views: tuple[View, ...] = ()
    pairs: tuple[PosePair, ...] = ()
    streams: PoseStreams | None = None
    link: str = "palm"
    camera: CameraCalibration | None = None
    markers: MarkerSettings | None = None


def load_data(path: Path) -> ForearmData:
    """Read recorded observations.

    Raises:
        ConfigurationError: the file cannot be read, has an unknown format, or contains a matrix that is not a rigid
            motion.
    """
    content = _json(path)
    if isinstance(content, list):
        return ForearmData(pairs=_pairs(validate(content, _Pairs, where=str(path)).root, str(path)))
    if isinstance(content, dict) and content.get("format") == STREAMS_FORMAT:
        streams = read_streams(content, str(path))
        return ForearmData(pairs=streams.pairs_at(streams.first_delay_s), streams=streams)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        hint = f"Give a file with format {FORMAT} or {STREAMS_FORMAT}, or a list of pairs of 4 x 4 matrices"
        raise ConfigurationError("contains no known kind of observations", where=str(path), hint=hint)
    file = validate(content, DataFile, where=str(path))
    if bool(file.touches) == bool(file.views):
        hint = "Keep one kind in the file; record the other with another run of the wizard"
        raise ConfigurationError("needs either touches or views", where=str(path), hint=hint)
    if file.views and (file.camera is None or file.markers is None):
        hint = "Add the camera's lens and the markers' sizes, as the wizard records them"
        raise ConfigurationError("views need camera and markers", where=str(path), hint=hint)
    form = HandForm(file.side, file.driven)
    return ForearmData(
        rig=file.rig,
        devices=file.devices,
        form=form,
        guess=file.guess.pose(),
        touches=tuple(_touch(entry, form) for entry in file.touches),
        views=tuple(_view(entry, form, index, str(path)) for index, entry in enumerate(file.views)),
        link=file.link,
        camera=file.camera,
        markers=file.markers,
    )


def save_data(path: Path, data: ForearmData) -> None:
    """Write observations, whole or not at all. Raises WriteError."""
    roll, pitch, yaw = data.guess.rotation().xyz()
    file = DataFile(
        rig=data.rig,
        devices=data.devices,
        side=data.form.side,
        driven=data.form.driven,
        guess=RigidTransform(translation_m=_three(data.guess.translation()), rpy_rad=(roll, pitch, yaw)),
        touches=tuple(map(_touch_entry, data.touches)),
        views=tuple(map(_view_entry, data.views)),
        link=data.link,  # type: ignore[arg-type]
        camera=data.camera,
        markers=data.markers,
    )
    write_whole(path, file.model_dump_json(indent=1))


def _json(path: Path) -> Any:
    try:
        return parse_json(read_input(path, LARGEST_JSON_bytes))
    except ValueError as error:
        raise ConfigurationError("is not JSON", where=str(path), hint="Check the file") from error


def _pairs(matrices: Sequence[tuple[Matrix, Matrix]], where: str) -> tuple[PosePair, ...]:
    return tuple(
        PosePair(rigid_pose(hand, f"{where}: pair {index + 1}"), rigid_pose(target, f"{where}: pair {index + 1}"))
        for index, (hand, target) in enumerate(matrices)
    )


def _touch(entry: TouchEntry, form: HandForm) -> Touch:
    return Touch(
        finger=entry.finger,
        pose=HandPose(np.array(entry.base_q), np.array(entry.joints_rad), form),
        point_distal_m=np.array(entry.point_distal_m),
        normal_distal=np.array(entry.normal_distal),
        point_covariance_m2=np.array(entry.point_covariance_m2),
        target=_target(entry.target),
        force_N=entry.force_N,
    )


def _target(entry: PlaneEntry | SpotEntry) -> Target:
    if isinstance(entry, SpotEntry):
        return Spot(entry.name, np.array(entry.point_world_m), entry.sigma_m)
    normal = np.array(entry.normal_world)
    return Plane(entry.name, np.array(entry.point_world_m), normal / np.linalg.norm(normal), entry.sigma_m)


def _view(entry: ViewEntry, form: HandForm, index: int, where: str) -> View:
    if len(entry.board_m) != len(entry.board_px) or len(entry.board_m) < 4:
        what = f"view {index + 1} needs as many pixels as corners, and at least four"
        raise ConfigurationError(what, where=where, hint="Check board_m and board_px")
    return View(
        pose=HandPose(np.array(entry.base_q), np.array(entry.joints_rad), form),
        board_m=np.array(entry.board_m),
        board_px=np.array(entry.board_px),
        world_px=None if entry.world_px is None else np.array(entry.world_px),
    )


def _touch_entry(touch: Touch) -> TouchEntry:
    target, place = touch.target, _three(touch.target.point_world_m)
    entry: PlaneEntry | SpotEntry = SpotEntry(name=target.name, point_world_m=place, sigma_m=target.sigma_m)
    if isinstance(target, Plane):
        normal = _three(target.normal_world)
        entry = PlaneEntry(name=target.name, point_world_m=place, normal_world=normal, sigma_m=target.sigma_m)
    if touch.finger not in FINGERS:
        hint = f"Fingers: {', '.join(FINGERS)}"
        raise ConfigurationError(f"unknown finger {touch.finger}", where="touches", hint=hint)
    return TouchEntry.model_validate(
        {
            "finger": touch.finger,
            "base_q": tuple(touch.pose.base_q.tolist()),
            "joints_rad": tuple(touch.pose.joints_rad.tolist()),
            "point_distal_m": _three(touch.point_distal_m),
            "normal_distal": _three(touch.normal_distal),
            "point_covariance_m2": tuple(map(_three, touch.point_covariance_m2)),
            "force_N": touch.force_N,
            "target": entry,
        }
    )


def _view_entry(view: View) -> ViewEntry:
    return ViewEntry.model_validate(
        {
            "base_q": tuple(view.pose.base_q.tolist()),
            "joints_rad": tuple(view.pose.joints_rad.tolist()),
            "board_m": tuple(map(_three, view.board_m)),
            "board_px": tuple(tuple(pixel) for pixel in view.board_px.tolist()),
            "world_px": None if view.world_px is None else tuple(tuple(pixel) for pixel in view.world_px.tolist()),
        }
    )


def _three(values: Any) -> Vector3:
    x, y, z = (float(value) for value in values)
    return x, y, z
