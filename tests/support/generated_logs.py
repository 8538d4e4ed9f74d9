"""Unusual but valid contact logs: few or duplicated contacts, distant origins, large motions."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tactile_lab.experiments.data.planar_data import simulate

_SOUND = simulate("rectangle", 3, count=4)
_TINY, _USUAL, _LARGE = 1e-9, 1e-3, 0.2


def _rigid(turn_rad: float, place_m: tuple[float, float]) -> list[list[float]]:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec([0, 0, turn_rad]).as_matrix()
    matrix[:2, 3] = place_m
    return matrix.tolist()  # type: ignore[no-any-return]


_angles = st.sampled_from([0.0, 0.1, 0.35, -1.0, np.pi, 6.0])
_offsets = st.sampled_from([0.0, 1e-12, 0.01, -0.05, 0.3])


@st.composite
def _motion(draw: st.DrawFn, centre_m: tuple[float, float]) -> list[list[float]]:
    """A motion with a rotation about a centre, and a translation."""
    turn = draw(_angles)
    c, s = np.cos(turn), np.sin(turn)
    x, y = centre_m
    shift = (x - c * x + s * y + draw(_offsets), y - s * x - c * y + draw(_offsets))
    return _rigid(turn, shift)


@st.composite
def _grasp(draw: st.DrawFn, dimension: int, origin_m: tuple[float, float]) -> dict[str, Any]:
    """A normal grasp with some of its contacts left out, duplicated, moved or rotated."""
    contacts = []
    source = draw(st.sampled_from(_SOUND.grasps))
    chosen = draw(st.lists(st.sampled_from(source.contacts), max_size=5))
    for contact in chosen:
        point = np.add(contact.point_world_m, (*origin_m, 0.0))
        normal = np.array(contact.normal_world)
        if draw(st.integers(0, 5)) == 0:
            point[:2] += [draw(_offsets), draw(_offsets)]
        if draw(st.integers(0, 5)) == 0:
            normal = Rotation.from_rotvec([0, 0, draw(_angles)]).apply(normal)
        if dimension == 3:
            point[2] = draw(st.sampled_from([0.0, 0.02, 0.05, -0.01]))
        entry: dict[str, Any] = {
            "finger": draw(st.sampled_from(["FF", "MF", "TH", "tool"])),
            "point_world_m": point.tolist(),
            "normal_world": normal.tolist(),
        }
        if draw(st.integers(0, 7)) == 0:
            entry["point_covariance_m2"] = (draw(st.sampled_from([0.0, 1e-12, 1e-2])) * np.eye(3)).tolist()
        contacts.append(entry)
    grasp: dict[str, Any] = {
        "stamp_s": draw(st.sampled_from([0.0, 1.0, 1e9])),
        "contacts": contacts,
        "hand_motion_world": draw(_motion(origin_m)),
    }
    if draw(st.integers(0, 3)) == 0:
        ends = [[origin_m[0] + draw(_offsets), origin_m[1] + draw(_offsets), 0.0] for _ in range(2)]
        grasp["closing_lines"] = [
            {"finger": "FF", "start_world_m": ends[0], "end_world_m": ends[1], "touched": draw(st.booleans())}
        ]
    if draw(st.booleans()):
        grasp["world_T_object"] = _rigid(draw(_angles), (origin_m[0] + draw(_offsets), origin_m[1]))
    return grasp


@st.composite
def logs(draw: st.DrawFn) -> dict[str, Any]:
    """Documents of the form ``tactile-contacts/1``, most of which pass its checks."""
    dimension = draw(st.sampled_from([2, 2, 3]))
    origin_m = draw(st.sampled_from([(0.0, 0.0), (0.0, 0.0), (99.0, -98.0)]))
    outline = draw(st.sampled_from([None, _SOUND.outline_m.tolist(), [[0, 0], [0.01, 0], [0.01, 1e-4]]]))
    document = {
        "format": "tactile-contacts/1",
        "dimension": dimension,
        "point_sigma_m": draw(st.sampled_from([_TINY, _USUAL, _LARGE])),
        "normal_sigma_rad": draw(st.sampled_from([1e-6, 0.09, 3.0])),
        "grasps": draw(st.lists(_grasp(dimension, origin_m), min_size=1, max_size=3)),
    }
    if draw(st.booleans()):
        sigmas = st.sampled_from([0.0, _USUAL, _LARGE])
        document["motion_sigma"] = {"translation_m": draw(sigmas), "rotation_rad": draw(sigmas)}
    if outline is not None:
        document["object"] = {"polygon_m": outline}
    return document


_ODD = (
    None,
    "",
    "x",
    True,
    -1,
    0,
    1e-320,
    1e308,
    -1e308,
    1e6,
    float("nan"),
    float("inf"),
    10**400,
    [],
    {},
    [[]],
    "\x00",
)


@st.composite
def damaged_logs(draw: st.DrawFn) -> dict[str, Any]:
    """The same with up to four entries somewhere in them replaced, removed or repeated."""
    document = draw(logs())
    for _ in range(draw(st.integers(1, 4))):
        inside: Any = document
        while True:
            places = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
            if not places:
                break
            place = draw(st.sampled_from(places))
            if isinstance(inside[place], dict | list) and draw(st.integers(0, 4)):
                inside = inside[place]
                continue
            _damage(draw, inside, place)
            break
    return document


def _damage(draw: st.DrawFn, inside: Any, place: Any) -> None:
    match draw(st.sampled_from(["replace", "replace", "remove", "repeat"])):
        case "replace":
            inside[place] = draw(st.sampled_from(_ODD))
        case "remove":
            del inside[place]
        case "repeat" if isinstance(inside, list):
            inside.insert(place, inside[place])
