"""A forearm-to-world calibration on a rig: the wizard's plan and the station that measures it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from gtsam import Pose3

from calibration.forearm import load_forearm
from calibration.forearm_wizard import ForearmWizard, Planned, WizardSettings
from calibration.geometry import load_geometry
from calibration.recordings import ForearmData
from calibration.touch_plan import plan_touches
from calibration.view_plan import PALM_T_BOARD, ViewSettings, plan_views
from drivers.biotac.biotac import EllipsoidSkinSettings, load_biotacs
from drivers.camera.boards import GridBoard, load_board
from drivers.camera.calibration import load_camera
from drivers.camera.markers import MarkerSettings
from drivers.fingertip import RigidTransform, load_fingertips
from drivers.shadow.posture import LONG_FINGERS, TipEllipsoid
from drivers.simulation.settings import HandBoard, ObjectStart
from sessions.bench import Bench
from sessions.calibration_station import Board, CalibrationStation, StationSettings
from sessions.recorder import TrafficSink
from tactile_lab.errors import ConfigurationError
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.laboratory import connected_bench
from tactile_lab.strict_yaml import StrictModel, load_model

_ASIDE = ObjectStart(x_m=0.44, y_m=0.44, yaw_rad=0.0)
"""Where a simulated rig's object lies while the hand calibrates: in a corner of the table."""

_ASKEW_rad, _ASKEW_m = 0.03, 0.003


class CalibrationSettings(StrictModel):
    """A file of settings for ``calibrate forearm``.

    Attributes:
        wizard: the least motion, limits, errors.
        station: how the hand moves.
        views: where the board is shown.
    """

    wizard: WizardSettings = WizardSettings()
    station: StationSettings = StationSettings()
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
) -> Iterator[tuple[ForearmWizard, CalibrationStation]]:
    """A wizard with a connected station; the hand is lifted off and everything closed in the end.

    Args:
        request: see there.
        onlooker: is shown the hand while it moves.

    Raises:
        ConfigurationError: the rig lacks what the method needs.
        DeviceError: the rig is not ready.
    """
    check_calibration(request.rig)
    rig = _prepared(request)
    plan, data = _plan(rig, request), _data(rig, request.method)
    wizard = ForearmWizard("touch" if request.method == "touch" else "marker", plan, data, request.settings.wizard)
    with connected_bench(rig, request.seed, "box-10x6x4", onlooker) as bench:
        station = _station(rig, request, data, bench)
        yield wizard, station
        station.close()


def _station(rig: Rig, request: ForearmRequest, data: ForearmData, bench: Bench) -> CalibrationStation:
    board = None if request.method == "touch" else hand_board(rig, request)
    return CalibrationStation(bench, data.guess, tip_shapes(rig), request.settings.station, board, data.markers)


def tip_shapes(rig: Rig) -> dict[str, TipEllipsoid]:
    """The ellipsoid of each fingertip, as its calibration has it."""
    if rig.description.fingertips == "nano17":
        tips = load_fingertips(rig.files["fingertips"])
        return {finger: TipEllipsoid(tip.semi_axes_m, tip.centre_distal_m) for finger, tip in tips.items()}
    shapes = {}
    for finger, biotac in load_biotacs(rig.files["fingertips"]).items():
        if isinstance(biotac.skin, EllipsoidSkinSettings):
            shapes[finger] = _upright(biotac.distal_T_sensor.pose(), biotac.skin)
    return shapes


def _upright(distal_T_sensor: Pose3, skin: EllipsoidSkinSettings) -> TipEllipsoid:
    centre = np.asarray(distal_T_sensor.transformFrom(np.array(skin.centre_m)))
    axes = np.abs(distal_T_sensor.rotation().matrix()) @ np.array(skin.semi_axes_m)
    x, y, z = axes.tolist()
    return TipEllipsoid((x, y, z), (float(centre[0]), float(centre[1]), float(centre[2])))


def hand_board(rig: Rig, request: ForearmRequest) -> Board:
    """The board on the hand. Raises ConfigurationError when none is named."""
    if request.board is None and "board" not in rig.files:
        hint = "Print one with tactile-lab markers, glue it to the palm, and name its file with --board"
        raise ConfigurationError("no board on the hand is named", where=rig.source, hint=hint)
    return load_board(request.board or rig.files["board"])


def _plan(rig: Rig, request: ForearmRequest) -> tuple[Planned, ...]:
    if request.method == "marker":
        changes = {} if request.pictures is None else {"pictures": request.pictures}
        return plan_views(request.settings.views.model_copy(update=changes))
    if unknown := sorted(set(request.fingers) - set(LONG_FINGERS)):
        hint = f"Press with some of {', '.join(LONG_FINGERS)}"
        raise ConfigurationError(f"{', '.join(unknown)} can not be stretched alone", where="--fingers", hint=hint)
    if missing := sorted(set(request.fingers) - set(tip_shapes(rig))):
        raise ConfigurationError(f"has no calibrated fingertip on {', '.join(missing)}", where=rig.source)
    if request.geometry is None and "geometry" not in rig.files:
        hint = "State the table's edges, a block or marked points in a file and name it with --geometry"
        raise ConfigurationError("no geometry of known place is named", where=rig.source, hint=hint)
    geometry = load_geometry(request.geometry or rig.files["geometry"])
    return plan_touches(geometry, request.fingers, request.touches)


def _data(rig: Rig, method: str) -> ForearmData:
    here = rig.installation
    data = ForearmData(here.rig, dict(here.devices), load_forearm(rig.files["forearm"]).world_T_mount.pose())
    if method == "touch":
        return data
    if "camera" not in rig.files:
        hint = "Name its lens and markers in the rig file, or use --method touch"
        raise ConfigurationError("the rig has no camera", where=rig.source, hint=hint)
    markers = load_model(rig.files["markers"], MarkerSettings)
    return replace(data, camera=load_camera(rig.files["camera"]), markers=markers)


def _prepared(request: ForearmRequest) -> Rig:
    """A simulated rig with its object out of the way, and with a board glued on a little askew."""
    rig, changes = request.rig, dict[str, object]()
    if request.method == "marker" and rig.description.simulation.hand_board is None:
        board = hand_board(rig, request)
        if isinstance(board, GridBoard):
            changes["hand_board"] = HandBoard(board=board, palm_T_board=_askew(request.seed))
    return cleared(rig, changes)


def cleared(rig: Rig, changes: Mapping[str, object] | None = None) -> Rig:
    """A simulated rig with its object out of the way, and with further changes of the simulation."""
    simulation = rig.description.simulation.model_copy(update={"start": _ASIDE, **(changes or {})})
    return replace(rig, description=rig.description.model_copy(update={"simulation": simulation}))


def _askew(seed: int) -> RigidTransform:
    rng = np.random.default_rng(seed)
    off = np.concatenate([_ASKEW_rad * rng.standard_normal(3), _ASKEW_m * rng.standard_normal(3)])
    pose = PALM_T_BOARD.pose() * Pose3.Expmap(off)
    (x, y, z), (roll, pitch, yaw) = pose.translation().tolist(), pose.rotation().xyz().tolist()
    return RigidTransform(translation_m=(x, y, z), rpy_rad=(roll, pitch, yaw))
