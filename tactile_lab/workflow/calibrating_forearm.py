"""A forearm-to-world calibration on a rig: the wizard's plan and the measurer that carries it out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from gtsam import Pose3

from calibration.forearm.placement import load_forearm
from calibration.forearm.recordings import ForearmData
from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.view_plan import ViewSettings, palm_T_board, plan_views
from calibration.forearm.wizard import ForearmWizard, Planned, WizardSettings
from calibration.steps.geometry import load_geometry
from drivers.camera.boards import GridBoard, load_board
from drivers.camera.calibration import load_camera
from drivers.camera.markers import MarkerSettings
from drivers.camera.targets.chessboard import Chessboard
from drivers.core.configuration import StrictModel, load_model
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import RigidTransform
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import HandForm
from drivers.simulation.settings import HandBoard, ObjectStart
from sessions.measuring.calibration_measurer import Board, CalibrationMeasurer, MeasurerSettings
from sessions.recording.recorder import TrafficSink
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.laboratory import connected_runtime
from tactile_lab.rigs.wired import hand_form

_ASIDE = ObjectStart(x_m=0.44, y_m=0.44, yaw_rad=0.0)
"""Where a simulated rig's object lies while the hand calibrates: in a corner of the table."""

_ASKEW_rad, _ASKEW_m = 0.03, 0.003


class CalibrationSettings(StrictModel):
    """A file of settings for ``calibrate forearm``.

    Attributes:
        wizard: the least motion, limits, errors.
        measurer: how the hand moves.
        views: where the board is shown.
    """

    renamed: ClassVar = {"station": "measurer"}

    wizard: WizardSettings = WizardSettings()
    measurer: MeasurerSettings = MeasurerSettings()
    views: ViewSettings = ViewSettings()


@dataclass(frozen=True)
class ForearmRequest:
    """What a person asks for.

    Attributes:
        rig: the one to calibrate.
        method: touch or marker.
        seed: of a simulated rig.
        geometry, board: files instead of the rig's.
        fingers: that press.
        touches: of each face.
        pictures: of the board; the settings' number when None.
        settings: see there.
    """

    rig: Rig
    method: str
    seed: int = 0
    geometry: Path | None = None
    board: Path | None = None
    fingers: tuple[str, ...] = ("FF", "MF")
    touches: int = 8
    pictures: int | None = None
    settings: CalibrationSettings = field(default_factory=CalibrationSettings)


@contextmanager
def forearm_wizard(
    request: ForearmRequest, onlooker: TrafficSink
) -> Iterator[tuple[ForearmWizard, CalibrationMeasurer]]:
    """A wizard with a connected measurer; the hand is lifted off and everything closed in the end.

    Args:
        request: see there.
        onlooker: is shown the hand while it moves.

    Raises:
        ConfigurationError: the rig lacks what the method needs.
        DeviceError: the rig is not ready.
    """
    check_calibration(request.rig)
    rig = _prepare(request)
    plan, data = _plan(rig, request), _data(rig, request.method)
    wizard = ForearmWizard("touch" if request.method == "touch" else "marker", plan, data, request.settings.wizard)
    with connected_runtime(rig, request.seed, "box-10x6x4", onlooker) as runtime:
        measurer = _measurer(rig, request, data, runtime)
        yield wizard, measurer
        measurer.close()


def _measurer(rig: Rig, request: ForearmRequest, data: ForearmData, runtime: RigRuntime) -> CalibrationMeasurer:
    board = None if request.method == "touch" else hand_board(rig, request)
    return CalibrationMeasurer(runtime, data.guess, tip_shapes(rig), request.settings.measurer, board, data.markers)


def tip_shapes(rig: Rig) -> dict[str, TipEllipsoid]:
    """The ellipsoid of each fingertip, as its calibration has it."""
    kind, shapes = rig.description.fingertip_kind, {}
    for finger, tip in kind.load(rig.files).items():
        if (surface := kind.surface(tip)) is not None:
            shapes[finger] = _upright(*surface)
    return shapes


def _upright(semi_axes_m: tuple[float, float, float], distal_T_tip: Pose3) -> TipEllipsoid:
    """The same with axes along those of the distal frame."""
    x, y, z = (np.abs(distal_T_tip.rotation().matrix()) @ np.array(semi_axes_m)).tolist()
    centre_x, centre_y, centre_z = distal_T_tip.translation().tolist()
    return TipEllipsoid((x, y, z), (centre_x, centre_y, centre_z))


def hand_board(rig: Rig, request: ForearmRequest) -> Board:
    """The board on the hand. Raises ConfigurationError when none is named, or a chessboard."""
    if request.board is None and "board" not in rig.files:
        hint = "Print one with tactile-lab markers, glue it to the palm, and give its file with --board"
        raise ConfigurationError("no board on the hand is given", where=rig.source, hint=hint)
    file = request.board or rig.files["board"]
    if isinstance(board := load_board(file), Chessboard):
        hint = "Print another one for the hand: tactile-lab markers grid"
        raise ConfigurationError("a chessboard looks the same upside down", where=str(file), hint=hint)
    return board


def _plan(rig: Rig, request: ForearmRequest) -> tuple[Planned, ...]:
    form = hand_form(rig)
    if request.method == "marker":
        changes = {} if request.pictures is None else {"pictures": request.pictures}
        return plan_views(request.settings.views.model_copy(update=changes), form)
    if unknown := sorted(set(request.fingers) - set(form.long_fingers)):
        hint = f"Press with some of {', '.join(form.long_fingers)}"
        raise ConfigurationError(f"{', '.join(unknown)} cannot be stretched on its own", where="--fingers", hint=hint)
    if missing := sorted(set(request.fingers) - set(tip_shapes(rig))):
        raise ConfigurationError(f"has no calibrated fingertip on {', '.join(missing)}", where=rig.source)
    if request.geometry is None and "geometry" not in rig.files:
        hint = "Describe the table's edges, a block or marked points in a file, and give it with --geometry"
        raise ConfigurationError("no geometry with a known pose is given", where=rig.source, hint=hint)
    geometry = load_geometry(request.geometry or rig.files["geometry"])
    return plan_touches(geometry, request.fingers, request.touches, form)


def _data(rig: Rig, method: str) -> ForearmData:
    here = rig.installation
    guess = load_forearm(rig.files["forearm"]).world_T_mount.pose()
    data = ForearmData(here.rig, dict(here.devices), hand_form(rig), guess)
    if method == "touch":
        return data
    if "camera" not in rig.files:
        hint = "Add its lens and markers to the rig file, or use --method touch"
        raise ConfigurationError("the rig has no camera", where=rig.source, hint=hint)
    markers = load_model(rig.files["markers"], MarkerSettings)
    return replace(data, camera=load_camera(rig.files["camera"]), markers=markers)


def _prepare(request: ForearmRequest) -> Rig:
    """A simulated rig with its object out of the way, and with a board glued on a little askew."""
    rig, changes = request.rig, dict[str, object]()
    if request.method == "marker" and rig.description.simulation.hand_board is None:
        board = hand_board(rig, request)
        if isinstance(board, GridBoard):
            changes["hand_board"] = HandBoard(board=board, palm_T_board=_askew(request.seed, hand_form(rig)))
    return clear_table(rig, changes)


def clear_table(rig: Rig, changes: Mapping[str, object] | None = None) -> Rig:
    """A simulated rig with its object out of the way, and with further changes of the simulation."""
    simulation = rig.description.simulation.model_copy(update={"start": _ASIDE, **(changes or {})})
    return replace(rig, description=rig.description.model_copy(update={"simulation": simulation}))


def _askew(seed: int, form: HandForm) -> RigidTransform:
    rng = np.random.default_rng(seed)
    off = np.concatenate([_ASKEW_rad * rng.standard_normal(3), _ASKEW_m * rng.standard_normal(3)])
    pose = palm_T_board(form).pose() * Pose3.Expmap(off)
    (x, y, z), (roll, pitch, yaw) = pose.translation().tolist(), pose.rotation().xyz().tolist()
    return RigidTransform(translation_m=(x, y, z), rpy_rad=(roll, pitch, yaw))
