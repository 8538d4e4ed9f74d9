"""Hostile YAML, JSON, tables and XML."""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Callable, Iterator
from importlib import resources
from pathlib import Path
from typing import Any

from tests.support.hostile.case import FILE, Case, Kind

_RIG = Kind("rig file", ("rig", "show", FILE), ".yaml")
_CALIBRATION = Kind("calibration", ("calibrate", "show", FILE), ".yaml")
_SETTINGS = Kind("settings", ("calibrate", "forearm", "--settings", FILE, "--no-input", "--out", "f.yaml"), ".yaml")
_LENS = Kind("OpenCV lens", ("evaluate", "SESSION", "--lens", FILE, "--out", "compared"), ".yaml")
_LOG = Kind("contact log", ("reconstruct", FILE, "--method", "odometry"), ".json")
_TIMED_TABLE = Kind("timed contacts", ("session", "import", FILE, "--out", "log.json"), ".csv")
_TIMED_JSON = Kind("timed contacts", ("session", "import", FILE, "--out", "log.json"), ".json")
_PRESSES = Kind("presses", ("calibrate", "biotac", FILE), ".csv")
_ELECTRODES = Kind("electrodes", ("calibrate", "electrodes", "--from", FILE, "--no-input"), ".txt")
_FOREARM = Kind("poses", ("calibrate", "forearm", "--from", FILE, "--no-input", "--out", "f.yaml"), ".json")
_SENSOR = Kind("sensor calibration", ("rig", "check", FILE), ".yaml")

MB = 1_000_000
_TIPS = Path(str(resources.files("tactile_lab.rigs"))) / "calibrations" / "simulated-hand" / "fingertips.yaml"
_NOISE = random.Random(1).randbytes(200_000)


def text_cases() -> Iterator[Case]:
    """All of them."""
    yaml, texts = _yaml(), _json()
    yield from _RIG.cases({**yaml, **_rigs()})
    yield from _CALIBRATION.cases({name: yaml[name] for name in ("noise", "aliases of aliases", "33 000 keys")})
    yield from _SETTINGS.cases({name: yaml[name] for name in ("15 MB", "merges of merges", "a Python object")})
    yield from _LENS.cases({"a matrix of a billion": _LENS_MATRIX, "noise behind the head": b"%YAML:1.0\n" + _NOISE})
    yield from _LENS.cases({"a pipe": os.mkfifo})
    yield from _LOG.cases({**texts, **_logs()})
    yield from _TIMED_TABLE.cases(_timed_tables())
    yield from _TIMED_JSON.cases({name: texts[name] for name in ("16 MB of brackets", "20 kB of brackets")})
    yield from _PRESSES.cases(_presses())
    yield from _ELECTRODES.cases({"noise": _NOISE, "one line of 15 MB": "1 " * (15 * MB // 2), "words": "a b\n" * 20})
    yield from _FOREARM.cases({name: texts[name] for name in ("noise", "16 MB of brackets", "a number of 5 MB")})
    yield from _SENSOR.cases({name: _with_sensor(xml) for name, xml in _sensors().items()})


# --- YAML ----------------------------------------------------------------------------------------------------------


def _yaml() -> dict[str, bytes | str | Callable[[Path], None]]:
    levels = "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 30))
    merges = "".join(f"m{n}: &m{n} {{<<: [{', '.join([f'*m{n - 1}'] * 9)}], k{n}: 1}}\n" for n in range(1, 30))
    return {
        "empty": b"",
        "noise": _NOISE,
        "UTF-16": "name: x\n".encode("utf-16"),
        "zero bytes": bytes(10_000),
        "15 MB": "a: 1\n" * (3 * MB),
        "1 MB in one word": "a" * (MB - 1),
        "aliases of aliases": "a0: &a0 [1]\n" + levels,
        "merges of merges": "m0: &m0 {k: 1}\n" + merges,
        "many merges of one": f"a: &a {{{', '.join(f'k{n}: 1' for n in range(3000))}}}\n"
        + "".join(f"m{n}: {{<<: *a}}\n" for n in range(30_000)),
        "an alias in itself": "a: &a [*a]\n",
        "20 kB of brackets": "[" * 20_000,
        "33 000 keys": "".join(f"key{n:05d}: {n}\n" for n in range(33_000)),
        "140 000 short keys": "".join(f"{n}:\n" for n in range(140_000))[: MB - 10].rpartition("\n")[0],
        "490 000 entries": f"a: [{'1,' * 490_000}]",
        "a Python object": "a: !!python/object/apply:os.system ['touch executed']\n",
        "a number of 900 kB": f"cycle_s: {'9' * 900_000}\n",
        "a number to the base of 60": f"cycle_s: 1{':10' * 300_000}\n",
        "a hexadecimal number of 900 kB": f"cycle_s: 0x{'f' * 900_000}\n",
        "an escape of every character": 'name: "' + "\\x41" * 240_000 + '"\n',
        "a date that there is not": "name: 9999-99-99\n",
        "two documents": "a: 1\n---\nb: 2\n",
        "100 000 anchors": "".join(f"- &a{n} 1\n" for n in range(80_000)),
    }


def _rigs() -> dict[str, bytes | str | Callable[[Path], None]]:
    base = "name: x\nsummary: x\nkind: simulated\ncycle_s: 0.01\n"
    return {
        "a pipe": lambda path: os.mkfifo(path),
        "a device without an end": lambda path: path.symlink_to("/dev/zero"),
        "a link to itself": lambda path: path.symlink_to(path),
        "a folder": lambda path: path.mkdir(),
        "calibrations that are devices": base + "calibration: {joints: /dev/zero, motors: /dev/random}\n",
        "itself as its calibration": base + "calibration: {joints: hostile.yaml}\n",
        "an extension that is a device": base + "extensions: [/dev/zero]\n",
    }


_LENS_MATRIX = (
    "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 100000\n   cols: 10000\n   dt: d\n   data: [ 1. ]\n"
)


# --- JSON ----------------------------------------------------------------------------------------------------------


def _json() -> dict[str, bytes | str | Callable[[Path], None]]:
    return {
        "empty": b"",
        "noise": _NOISE,
        "20 kB of brackets": "[" * 20_000,
        "16 MB of brackets": "[" * (16 * MB),
        "16 MB of closed brackets": "[" + "[]," * (5 * MB) + "[]]",
        "17 MB": " " * (17 * MB),
        "a number of 5 MB": '{"format": ' + "9" * (5 * MB) + "}",
        "half a surrogate": r'{"format": "\ud800"}',
        "a million keys": "{" + ",".join(f'"{n}":0' for n in range(MB)) + "}",
        "a key twice": '{"format": 1, "format": 2}',
    }


def _log(**changes: Any) -> str:
    content = {
        "format": "tactile-contacts/1",
        "dimension": 2,
        "point_sigma_m": 0.001,
        "normal_sigma_rad": 0.1,
        "grasps": _grasps(3, 2),
    }
    return json.dumps({**content, **changes})


def _grasps(count: int, contacts: int, point_m: float = 0.03) -> list[dict[str, Any]]:
    contact = {"finger": "FF", "point_world_m": [point_m, 0, 0.02], "normal_world": [1, 0, 0]}
    pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    return [{"contacts": [contact] * contacts, "hand_motion_world": pose}] * count


def _logs() -> dict[str, bytes | str | Callable[[Path], None]]:
    star = [[0.1 * (n % 2), 0.001 * (n * 7 % 2000)] for n in range(2000)]
    return {
        "10 001 grasps": _log(grasps=_grasps(10_001, 1)),
        "1 grasp of 100 000 contacts": _log(grasps=_grasps(1, 100_000)),
        "1000 grasps of 99 contacts, the last wrong": _log(grasps=[*_grasps(1000, 99), {"contacts": 1}]),
        "places of 1e308 m": _log(grasps=_grasps(3, 2, 1e308)),
        "an outline that crosses itself 2000 times": _log(object={"name": "star", "polygon_m": star}),
        "an outline of a million corners": _log(object={"name": "x", "polygon_m": [[0.0, 0.0]] * 500_000}),
        "a mesh that is another file": _log(object={"name": "x", "mesh": "../../../../etc/passwd"}),
        "no grasps": _log(grasps=[]),
        "all contacts at one place": _log(grasps=_grasps(12, 5)),
    }


# --- tables --------------------------------------------------------------------------------------------------------


def _timed_tables() -> dict[str, bytes | str | Callable[[Path], None]]:
    head = "time_s,grasp,finger,x_m,y_m,z_m,nx,ny,nz\n"
    return {
        "noise": _NOISE,
        "50 001 lines": head + "0,1,FF,0,0,0,1,0,0\n" * 50_001,
        "one line of 15 MB": head + "0," * (15 * MB // 2),
        "two million columns": "a," * (2 * MB),
        "a quotation of 15 MB": head + '"' + "x" * (15 * MB),
        "a million short lines": "\n" * MB,
        "zero bytes": head.encode() + bytes(100_000),
        "no numbers": head + "nan,inf,FF,1e999,-inf,nan,0,0,0\n" * 100,
        "17 MB": head + "0,1,FF,0,0,0,1,0,0\n" * 900_000,
    }


def _presses() -> dict[str, bytes | str | Callable[[Path], None]]:
    head = ",".join(f"e{n}" for n in range(1, 20)) + ",nx,ny,nz\n"
    return {
        "noise": _NOISE,
        "15 MB of equal samples": head + ("2000," * 19 + "0,0,1\n") * 150_000,
        "a million columns": "e1," * MB + "\n",
        "samples without a normal": head + ("2000," * 19 + ",,\n") * 1000,
    }


# --- XML -----------------------------------------------------------------------------------------------------------


def _sensors() -> dict[str, str]:
    laughs = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 12))
    return {
        "entities of entities": f'<!DOCTYPE x [<!ENTITY l0 "ha">{laughs}]><FTSensor>&l11;</FTSensor>',
        "an entity that is a file": '<!DOCTYPE x [<!ENTITY f SYSTEM "file:///etc/passwd">]><FTSensor>&f;</FTSensor>',
        "nested 100 000 deep": "<a>" * 100_000,
        "1 MB of attributes": "<FTSensor " + " ".join(f'a{n}="1"' for n in range(70_000)) + "/>",
        "2 MB": "<FTSensor>" + " " * (2 * MB) + "</FTSensor>",
    }


def _with_sensor(xml: str) -> Callable[[Path], None]:
    """A rig file whose fingertip has this calibration."""

    def make(path: Path) -> None:
        (path.parent / "sensor.cal").write_text(xml)
        wire = "{wire: gauge-volts, calibration: sensor.cal, local_port: 45000}"
        path.write_text(f"name: x\nsummary: x\nkind: fingertips\ncalibration: fingertips.yaml\nwires:\n  TH: {wire}\n")
        shutil.copy(_TIPS, path.parent / "fingertips.yaml")

    return make
