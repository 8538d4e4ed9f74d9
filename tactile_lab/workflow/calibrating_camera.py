"""Collects views of a board from a camera, a folder or a video, and stores the lens calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from calibration.camera.intrinsics import PARAMETERS, LensLimits, LensResult
from calibration.camera.views import BoardView, Coverage, adds_something, coverage, view_of
from calibration.store.store import CalibrationRecord, Covariance, new_record
from drivers.camera.boards import AnyBoard
from drivers.camera.detection import other_dictionary
from drivers.camera.frames import Image
from drivers.camera.pictures import Picture
from drivers.camera.source_settings import CameraSourceSettings
from drivers.camera.sources import open_source
from drivers.camera.targets.chessboard import Chessboard
from drivers.core.clock import Clock
from drivers.core.errors import ConfigurationError

LENS_COMMENT = "Lens of the camera under the table. Made by tactile-lab calibrate camera."
_LENS_VALID_DAYS = 365.0


@dataclass
class Gathering:
    """Views so far, and the outcome of each picture.

    Attributes:
        views: those used.
        pictures: number examined.
        refused: reasons by picture.
        alike: number of pictures that show nothing new.
        newest: name of the picture that was examined last.
    """

    views: list[BoardView] = field(default_factory=list)
    pictures: int = 0
    refused: dict[str, str] = field(default_factory=dict)
    alike: int = 0
    newest: str = ""

    @property
    def coverage(self) -> Coverage:
        """The coverage of the views."""
        return coverage(self.views)


def gather_views(
    settings: CameraSourceSettings,
    board: AnyBoard,
    clock: Clock,
    *,
    most: int = 60,
    least: int = 12,
    told: Callable[[Gathering], None] = lambda gathering: None,
    goes_on: Callable[[], bool] = lambda: True,
) -> Gathering:
    """Views of the board: all of a folder or video, of a camera until nothing is missing.

    Args:
        most: end with this many views.
        least: a camera is not stopped before this many, even with full coverage.
        told: called after each picture that was used or refused, for guidance.
        goes_on: asked before each picture; False ends with the views there are.

    Raises:
        ConfigurationError: no such source, or no picture shows the board; the dictionary it does show is named.
        DeviceError: the camera cannot be used, or changes its resolution.
    """
    source, found = open_source(settings, clock), Gathering()
    is_camera = settings.place().kind in ("device", "gstreamer")
    last: Image | None = None
    try:
        while len(found.views) < most and goes_on() and (picture := source.read()) is not None:
            last = picture.image
            if _take(found, picture, board):
                told(found)
            if is_camera and len(found.views) >= least and not found.coverage.missing:
                break
    finally:
        source.close()
    if not found.views:
        raise _nothing_found(settings.source, board, last, found)
    return found


def _take(found: Gathering, picture: Picture, board: AnyBoard) -> bool:
    """Examine one picture. Returns whether it adds anything."""
    found.pictures += 1
    name = found.newest = picture.name
    view = view_of(name, picture.image, board)
    if isinstance(view, str):
        found.refused[name] = view
        return True
    if not adds_something(view, found.views):
        found.alike += 1
        return False
    found.views.append(view)
    return True


def _nothing_found(source: str, board: AnyBoard, last: Image | None, found: Gathering) -> ConfigurationError:
    described = board.kind if isinstance(board, Chessboard) else board.dictionary
    other = None if last is None else other_dictionary(last, described)
    if other is not None:
        what = f"the pictures show markers of {other}, but the board is described with {described}"
        return ConfigurationError(what, where=source, hint="Give the description of this board with --board")
    reasons = sorted(set(found.refused.values()))
    what = f"none of the {found.pictures} pictures shows the board ({'; '.join(reasons[:3])})"
    return ConfigurationError(what, where=source, hint="Check the board's description, light and focus")


def lens_record(
    result: LensResult, measurer: str, board: AnyBoard, limits: LensLimits, serial: str, notes: str = ""
) -> CalibrationRecord:
    """The result as a record for the store."""
    names = [name for name in PARAMETERS if name in result.sigmas]
    variances = tuple(tuple(result.sigmas[name] ** 2 if name == other else 0.0 for other in names) for name in names)
    residuals = {
        "reprojection_px": result.reprojection_px,
        "held_out_px": None if result.held_out_px != result.held_out_px else result.held_out_px,
        "per_view_px": result.per_view_px,
        "left_out_px": result.left_out,
    }
    seen = result.coverage
    return new_record(
        "camera",
        rig=measurer,
        method=f"views of a {board.kind} board, calibrateCameraExtended",
        parameters=result.lens,
        verdict="PASS" if result.passed else "FAIL",
        devices={"camera": serial} if serial else {},
        covariance=Covariance(of=tuple(names), matrix=variances),
        residuals=residuals,
        limits={name: float(value) for name, value in limits.model_dump().items()},
        details={
            "sigmas": result.sigmas,
            "corners_by_region": seen.regions,
            "views_by_tilt": seen.tilts,
            "distances_board_sides": list(seen.distances),
            "problems": list(result.problems),
            "board": board.model_dump(mode="json"),
        },
        notes=notes,
        valid_days=_LENS_VALID_DAYS,
    )
