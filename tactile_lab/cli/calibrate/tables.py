"""Calibrations as tables for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from calibration.steps.quality import Judgement
from calibration.store.store import CalibrationRecord
from drivers.core.configuration import flatten_keys
from tactile_lab.cli.console import answer, show_facts, show_table

_LONGEST = 12
_LONGEST_TEXT = 200


def show_record(title: str, record: CalibrationRecord) -> None:
    """One stored calibration."""
    facts = [
        ("kind", record.kind),
        ("rig", record.rig),
        ("method", record.method),
        ("made", record.created_utc),
        ("valid until", record.valid_until_utc or "no expiry"),
        ("devices", ", ".join(f"{device} {serial}" for device, serial in record.devices.items())),
        *_lines(record.parameters),
        *_lines(record.details),
        *_lines(record.residuals),
        *((f"limit {name}", f"{value:g}") for name, value in record.limits.items()),
        ("notes", record.notes),
    ]
    show_facts(title, facts)
    tell_verdict(record)


def tell_verdict(record: CalibrationRecord) -> None:
    """PASS or FAIL, coloured."""
    answer(record.verdict, "bold green" if record.verdict == "PASS" else "bold red")


def show_quality(judgements: Iterable[Judgement]) -> None:
    """Checks against their limits."""
    rows = [[j.name, f"{j.value:.2f} {j.unit}", f"{j.limit:.2f}", "ok" if j.ok else "OUTSIDE"] for j in judgements]
    show_table("Quality", ["", "is", "limit", ""], rows, right=(1, 2))


def _lines(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Nested names with their values; long lists by their length."""
    return [(name, _text(value)) for name, value in flatten_keys(content) if not isinstance(value, Mapping)]


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value + 0.0:.6g}"  # no minus before zero
    if isinstance(value, list | tuple):
        if len(value) > _LONGEST or any(isinstance(part, list | tuple | Mapping) for part in value):
            return f"{len(value)} entries"
        return "  ".join(map(_text, value))
    return _short(str(value))


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST_TEXT else f"{len(text)} characters"
