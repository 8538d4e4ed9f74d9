"""Kalibr's description of a target (``target_type: aprilgrid`` or ``checkerboard``) as one of our own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field

from drivers.core.configuration import StrictModel, validate
from drivers.core.errors import ConfigurationError


class _AprilGridFile(StrictModel):
    target_type: Literal["aprilgrid"]
    tagCols: int
    tagRows: int
    tagSize: float = Field(gt=0.0)
    tagSpacing: float = Field(gt=0.0)


class _CheckerboardFile(StrictModel):
    target_type: Literal["checkerboard"]
    targetCols: int
    targetRows: int
    rowSpacingMeters: float = Field(gt=0.0)
    colSpacingMeters: float = Field(gt=0.0)


def board_of_kalibr(content: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The content of our description of the same target. Kalibr counts a chessboard's inner corners, we its squares.

    Raises:
        ConfigurationError: another kind of target, a wrong key, or squares that are not square.
    """
    if content["target_type"] == "aprilgrid":
        grid = validate(dict(content), _AprilGridFile, where=where)
        gap_m = grid.tagSpacing * grid.tagSize
        sizes = {"side_m": grid.tagSize, "gap_m": gap_m}
        return {"kind": "aprilgrid", "columns": grid.tagCols, "rows": grid.tagRows, **sizes}
    if content["target_type"] == "checkerboard":
        board = validate(dict(content), _CheckerboardFile, where=where)
        if board.rowSpacingMeters != board.colSpacingMeters:
            what = f"squares of {board.colSpacingMeters:g} x {board.rowSpacingMeters:g} m are not square"
            raise ConfigurationError(what, where=where, hint="Use a chessboard of squares")
        squares = {"columns": board.targetCols + 1, "rows": board.targetRows + 1}
        return {"kind": "chessboard", **squares, "square_m": board.colSpacingMeters}
    hint = "Use an aprilgrid, a checkerboard, or a print of tactile-lab markers"
    raise ConfigurationError(f"target_type {content['target_type']!r} is not known", where=where, hint=hint)
