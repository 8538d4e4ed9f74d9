"""A catalogue of sessions: what was done, with what, and how well, as one table for other programs' queries."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from drivers.core.errors import ConfigurationError, SessionError
from drivers.core.installed.extras import require_package
from sessions.exchange.addresses import address_of, write_anywhere
from sessions.exchange.elsewhere import list_elsewhere
from sessions.recording.listing import SessionSummary, list_sessions
from sessions.recording.manifest import Manifest
from sessions.recording.session import RESULTS, Session
from tactile_lab.evaluation.files.plain import read_json_object
from tactile_lab.workflow.plugging import RECORD

UNITS: Mapping[str, str] = {
    "session": "", "folder": "", "status": "", "started_utc": "ISO 8601", "duration_s": "s", "rig": "",
    "fingertips": "", "positioner": "", "object": "", "grasps": "", "method": "", "dimension": "", "policy": "",
    "seed": "", "evaluated_method": "", "result": "", "contacts": "", "failed": "", "registration_rms_mm": "mm",
    "hausdorff_mm": "mm",
    "hausdorff_best_fit_mm": "mm", "iou": "1", "pose_rmse_mm": "mm", "pose_rmse_deg": "deg", "sigma_median_mm": "mm",
    "data_loss": "", "traffic_bytes": "byte", "version": "", "plugins": "", "notes": "", "problem": "",
}  # fmt: skip
"""Columns, with the units of those that are quantities."""

_TYPES: Mapping[str, str] = {
    **dict.fromkeys(("grasps", "dimension", "seed", "contacts", "traffic_bytes"), "int64"),
    **dict.fromkeys(("failed", "data_loss"), "bool"),
    **dict.fromkeys((name for name, unit in UNITS.items() if unit in ("s", "mm", "deg", "1")), "float64"),
}
"""Types of the columns that are not text."""

_FIGURES = {
    "evaluated_method": ("method",),
    "result": ("status",),
    "contacts": ("contacts",),
    "failed": ("failed",),
    "registration_rms_mm": ("registration_rms_mm",),
    "hausdorff_mm": ("shape", "hausdorff_mm"),
    "hausdorff_best_fit_mm": ("shape_best_fit", "hausdorff_mm"),
    "iou": ("shape_best_fit", "iou"),
    "pose_rmse_mm": ("pose", "rmse_mm"),
    "pose_rmse_deg": ("pose", "rmse_deg"),
    "sigma_median_mm": ("uncertainty", "sigma_mm_median"),
}
"""Where a column stands in ``evaluation.json``."""

Line = dict[str, Any]


def catalogue(roots: Sequence[Path]) -> list[Line]:
    """One line for each session directly under the folders, oldest first; every column of :data:`UNITS`, None if
    unknown. A session that cannot be read has its problem.

    Args:
        roots: folders, or addresses such as ``s3://bucket/laboratory``, of which the records alone are read.

    Raises:
        ConfigurationError: a folder does not exist or cannot be read.
        WriteError: an address cannot be reached.
    """
    for root in roots:
        if address_of(root) is None and not root.is_dir():
            raise ConfigurationError("there is no such folder", where=str(root), hint="Name folders of sessions")
    lines = [line for root in roots for line in _lines(root)]
    return sorted(lines, key=lambda line: (line["started_utc"] or "", line["session"]))


def _lines(root: Path) -> list[Line]:
    """Of one folder, here or elsewhere."""
    if (address := address_of(root)) is None:
        return [_line(summary) for summary in list_sessions(root)]
    with TemporaryDirectory() as stand_ins:
        lines = [_line(summary) for summary in list_sessions(list_elsewhere(address, Path(stand_ins)))]
    return [line | {"folder": f"{address.rstrip('/')}/{Path(line['folder']).name}"} for line in lines]


def write_catalogue(lines: Sequence[Line], path: Path) -> None:
    """Write a table: ``.parquet`` with types and units, or ``.csv``; an earlier one is replaced as a whole.

    Args:
        lines: of :func:`catalogue`.
        path: of the file, or its address.

    Raises:
        ConfigurationError: another kind of file, or PyArrow is not installed; no such bucket.
        WriteError: it cannot be written.
    """
    check_table(path)
    write_anywhere(path, _parquet(lines) if path.suffix.lower() == ".parquet" else _csv(lines))


def check_table(path: Path) -> None:
    """Check that such a table can be written. Raises ConfigurationError as :func:`write_catalogue`."""
    if path.suffix.lower() not in (".parquet", ".csv"):
        raise ConfigurationError("is no table", where=str(path), hint="Name a .parquet or .csv file")
    if path.suffix.lower() == ".parquet":
        require_package("pyarrow")


def _csv(lines: Sequence[Line]) -> str:
    text = io.StringIO()
    table = csv.DictWriter(text, list(UNITS), lineterminator="\n")
    table.writeheader()
    table.writerows(lines)
    return text.getvalue()


def _parquet(lines: Sequence[Line]) -> bytes:
    import pyarrow
    from pyarrow import parquet

    fields = [
        pyarrow.field(name, _TYPES.get(name, "string"), metadata={"unit": unit} if unit else None)
        for name, unit in UNITS.items()
    ]
    table = pyarrow.Table.from_pylist(list(lines), schema=pyarrow.schema(fields, {"content": "tactile-lab catalogue"}))
    buffer = pyarrow.BufferOutputStream()
    parquet.write_table(table, buffer)
    written: bytes = buffer.getvalue().to_pybytes()
    return written


def _line(summary: SessionSummary) -> Line:
    line: Line = dict.fromkeys(UNITS)
    line |= {
        "session": summary.name,
        "folder": str(summary.folder.resolve()),
        "status": summary.status,
        "started_utc": summary.started_utc or None,
        "rig": summary.rig or None,
        "object": summary.object_name or None,
        "grasps": summary.grasps,
        "traffic_bytes": summary.traffic_bytes,
        "data_loss": summary.data_loss,
        "problem": summary.problem or None,
    }
    try:
        session = Session.open(summary.folder)
    except SessionError:  # its problem stands in the summary
        return line
    line |= _of_manifest(session.manifest) | _figures(session)
    return {name: _typed(name, value) for name, value in line.items()}


def _typed(name: str, value: Any) -> Any:
    """The value if it is what the column holds, else None: records of imports may say anything."""
    kind = _TYPES.get(name, "string")
    if isinstance(value, bool):
        return value if kind == "bool" else None
    if isinstance(value, int) and kind == "int64":
        return value if abs(value) < 2**63 else None
    if isinstance(value, int | float) and kind == "float64":
        return float(value)
    return value if isinstance(value, str) and kind == "string" else None


def _of_manifest(manifest: Manifest) -> Line:
    settings, rig = manifest.settings, manifest.rig_description
    return {
        "duration_s": _duration_s(manifest),
        "fingertips": rig.get("fingertips"),
        "positioner": rig.get("positioner"),
        "method": _inside(settings, "slam", "method"),
        "dimension": _inside(settings, "slam", "dimension"),
        "policy": settings.get("policy"),
        "seed": manifest.seeds.get("session"),
        "version": manifest.versions.get("tactile-lab"),
        "plugins": _plugin_words(settings.get(RECORD)) or None,
        "notes": manifest.notes or None,
    }


def _inside(content: Any, *keys: str) -> Any:
    """What stands under one key after the other; None where there is no such place."""
    for key in keys:
        content = content.get(key) if isinstance(content, Mapping) else None
    return content


def _plugin_words(used: Any) -> str:
    uses = [use for use in used if isinstance(use, Mapping)] if isinstance(used, list | tuple) else []
    return ", ".join(" ".join(str(use.get(key, "")) for key in ("kind", "name", "package", "version")) for use in uses)


def _duration_s(manifest: Manifest) -> float | None:
    if manifest.ended_utc is None:
        return None
    try:
        ends = [datetime.fromisoformat(text) for text in (manifest.started_utc, manifest.ended_utc)]
        return (ends[1] - ends[0]).total_seconds()
    except (ValueError, TypeError):  # times of an import that are none
        return None


def _figures(session: Session) -> Line:
    """What the evaluation of the session's own results says; nothing without one, and why if it cannot be read."""
    path = session.folder / RESULTS / "evaluation.json"
    if not os.path.lexists(path):
        return {}
    try:
        content = read_json_object(path, hint=f"Make it anew: tactile-lab evaluate {session.folder}")
    except SessionError as error:
        return {"status": "damaged", "problem": str(error)}
    return {name: _inside(content, *keys) for name, keys in _FIGURES.items()}
