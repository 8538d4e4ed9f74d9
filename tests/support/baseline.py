"""Numbers that a change must not move unseen: results of small fixed problems, stored under ``tests/baseline``.

python -m tests.support.baseline                              # makes all of them anew and says what has moved
python -m tests.support.baseline tests/unit/tactile_lab/slam  # those of some tests
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.support.repository import REPOSITORY

FOLDER = REPOSITORY / "tests" / "baseline"
_ANEW = "MAKE_BASELINES"
_SHARE = "BASELINE_SHARE"
_DIGITS = 12
_MOST_SHOWN = 12
_asked: set[str] = set()


def assert_baseline(name: str, values: Mapping[str, Any], *, rtol: float = 1e-6, atol: float = 1e-9) -> None:
    """Compare values with those stored in ``tests/baseline/NAME.json``.

    Args:
        name: of the file, with its folder: "tracking/motion_cost".
        values: what :func:`tests.support.plain_values.plain` makes numbers, texts, lists and mappings of. Whole numbers
            and texts have to be the same.
        rtol, atol: a number may differ by ``atol + rtol * |stored|``, times what the environment's BASELINE_SHARE says.
    """
    from tests.support.plain_values import plain  # numpy, which asks the tests' configuration for its kernels

    _asked.add(f"{name}.json")
    file, now = FOLDER / f"{name}.json", _rounded(plain(values))
    stored = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    share = float(os.environ.get(_SHARE, "1"))
    moved = list(differences(stored, now, share * rtol, share * atol))
    if moved and os.environ.get(_ANEW):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(_text(now), encoding="utf-8")
    elif moved:
        hint = "If that is meant, `python -m tests.support.baseline` stores the new ones; the commit says why."
        pytest.fail(f"{len(moved)} values of {name} have moved:\n{_shown(moved)}\n{hint}", pytrace=False)


def differences(stored: Any, now: Any, rtol: float = 0.0, atol: float = 0.0, where: str = "") -> Iterator[str]:
    """A line for each value that differs: where it stands, what is stored, what it is now."""
    if isinstance(stored, dict) and isinstance(now, dict):
        for key in stored | now:
            yield from differences(stored.get(key, "nothing"), now.get(key, "nothing"), rtol, atol, f"{where}.{key}")
    elif isinstance(stored, list) and isinstance(now, list) and len(stored) == len(now):
        for place, (one, other) in enumerate(zip(stored, now, strict=True)):
            yield from differences(one, other, rtol, atol, f"{where}[{place}]")
    elif isinstance(stored, float) and isinstance(now, float):
        if not (abs(now - stored) <= atol + rtol * abs(stored) or repr(now) == repr(stored)):
            yield f"{where.lstrip('.')}: {stored:.9g} stored, {now:.9g} now ({now - stored:+.2g})"
    elif type(stored) is not type(now) or stored != now:
        yield f"{where.lstrip('.')}: {stored} stored, {now} now"


def _rounded(value: Any) -> Any:
    """A plain value as JSON gives it back, floats rounded to what is worth storing."""
    if type(value) is float:
        return float(f"{value:.{_DIGITS}g}") + 0.0 if math.isfinite(value) else value
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    assert value is None or isinstance(value, bool | int | str), f"{type(value).__name__} cannot be stored"
    return value


def _text(values: Mapping[str, Any]) -> str:
    lines = ",\n".join(f" {json.dumps(key)}: {json.dumps(value)}" for key, value in values.items())
    return f"{{\n{lines}\n}}\n"


def _shown(moved: list[str]) -> str:
    left = len(moved) - _MOST_SHOWN
    return "\n".join(f"  {line}" for line in moved[:_MOST_SHOWN] + ([f"and {left} more"] if left > 0 else []))


def _stored() -> dict[str, Any]:
    return {
        str(file.relative_to(FOLDER)): json.loads(file.read_text(encoding="utf-8"))
        for file in sorted(FOLDER.rglob("*.json"))
    }


def _users() -> list[str]:
    return [str(file) for file in sorted((REPOSITORY / "tests").rglob("test_*.py")) if _uses_baselines(file)]


def _uses_baselines(file: Path) -> bool:
    return "assert_baseline(" in file.read_text(encoding="utf-8")


def main(tests: list[str]) -> int:
    """Run the tests that compare with baselines, storing what they find instead, and print what has moved.

    What no test asks for any more is deleted, if all of them have run.
    """
    before = _stored()
    os.environ[_ANEW] = "yes"
    code = int(pytest.main(["-q", *(tests or _users())]))
    for name in () if tests or code else before.keys() - _asked:
        (FOLDER / name).unlink()
        print(f"{name}: deleted, no test asks for it")
    for name, values in _stored().items():
        moved = list(differences(before.get(name, {}), values))
        if moved:
            print(f"{name}, {len(moved)} values:\n{_shown(moved)}")
    return code


if __name__ == "__main__":
    from tests.support import baseline  # the module that the tests import, not a second one

    sys.exit(baseline.main(sys.argv[1:]))
