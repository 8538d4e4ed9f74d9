"""The files of results made by hand, and such files entry by entry: what is read and what is refused, as before."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tactile_lab.evaluation.files.mesh_io import read_estimated_mesh, read_mesh, sigma_colours
from tactile_lab.evaluation.files.results import read_results
from tactile_lab.evaluation.files.tables import read_contacts, read_contour
from tactile_lab.evaluation.files.trajectory_file import read_trajectory
from tactile_lab.evaluation.files.tum_file import tum_text
from tactile_lab.evaluation.shape import horizontal_outline
from tests.support.baseline import assert_baseline
from tests.support.digest import digest_records
from tests.support.made_results import (
    COUNT,
    poses,
    written,
)
from tests.support.said import said

CLOSE = {"rtol": 1e-5, "atol": 1e-7}


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_files_of_results(dimension: int, tmp_path: Path) -> None:
    written(tmp_path, dimension, largest_sigma_m=0.003)
    told: dict[str, Any] = {"names": sorted(path.name for path in tmp_path.iterdir())}
    for path in sorted(tmp_path.glob("*.csv")):
        head, *rows = csv.reader(path.read_text().splitlines())
        told[path.name] = [head, len(rows), digest_records([_number(entry) for entry in row] for row in rows)]
    told["slam.json"] = digest_records([json.loads((tmp_path / "slam.json").read_text())])
    for name in sorted({"mesh.ply", "known.ply"} & set(told["names"])):
        whole = trimesh.load(tmp_path / name, process=False)
        data = whole.metadata["_ply_raw"]["vertex"]["data"]
        values = {column: data[column].astype(float) for column in data.dtype.names}
        told[name] = [len(whole.faces), digest_records(whole.faces[::5].tolist()), digest_records([values])]
        told[f"{name} begins"] = (tmp_path / name).read_bytes().partition(b"end_header")[0].decode()
    told["mesh.glb"] = len((tmp_path / "mesh.glb").read_bytes())
    estimated = read_estimated_mesh(tmp_path / "mesh.ply")
    told["read"] = [estimated.sigma_m.sum(), int(estimated.known.sum()), estimated.mesh.volume]
    told["contacts"] = [digest_records([vars(rows)]) for rows in read_results(tmp_path).contacts]
    assert_baseline(f"evaluation/files_{dimension}", told, **CLOSE)


def _number(entry: str) -> Any:
    try:
        return float(entry)
    except ValueError:
        return entry


def test_shape_files_that_are_refused_and_others(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.05))
    told: dict[str, Any] = {}
    open_box = trimesh.Trimesh(box.vertices, box.faces[:-2], process=False)
    kinds = {
        "box": box,
        "smallest": box.copy().apply_scale(0.0500001),
        "too small": box.copy().apply_scale(0.0499),
        "largest": trimesh.creation.box((1.0, 0.5, 0.25)),
        "too large": box.copy().apply_scale(10.01),
        "open": open_box,
        "inside out": trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False),
    }
    for name, mesh in kinds.items():
        path = tmp_path / f"{name}.stl"
        mesh.export(path)
        told[name] = said(lambda path=path: read_mesh(path).volume, tmp_path)
    told["no deviations"] = said(lambda: read_estimated_mesh(tmp_path / "box.stl"), tmp_path)
    told["missing"] = said(lambda: read_mesh(tmp_path / "none.stl"), tmp_path)
    told["colours"] = sigma_colours(np.array([0.0, 0.0005, 0.001, 0.0025, 0.005, 0.0075, 0.0099, 0.01, 0.5]))
    told["outlines"] = [horizontal_outline(box, height_m) for height_m in (-1.0, 0.0, 0.0249, 1.0)]
    tall = trimesh.util.concatenate(
        [box, trimesh.creation.box((0.02, 0.02, 0.05), trimesh.transformations.translation_matrix([0.2, 0, 0.01]))]
    )
    told["the larger of two"] = horizontal_outline(tall, 0.0)
    assert_baseline("evaluation/meshes", told)


def test_tables_that_are_refused(tmp_path: Path) -> None:
    """One entry or line after the other is wrong."""
    folder, told = written(tmp_path / "results", 2), {}
    readers = {
        "trajectory.csv": lambda: len(read_trajectory(folder / "trajectory.csv").stamps_s),
        "contacts.csv": lambda: [len(rows.fingers) for rows in read_contacts(folder / "contacts.csv", COUNT)],
        "contour.csv": lambda: list(read_contour(folder / "contour.csv").points_m.shape),
    }
    for name, reader in readers.items():
        path = folder / name
        lines = path.read_text().splitlines()
        cells = lines[2].split(",")
        wrong: dict[str, list[str]] = {
            "nothing": [],
            "no head": lines[1:],
            "only a head": lines[:1],
            "two lines": lines[:3],
            "four lines": lines[:5],
            "other head": ["a,b", *lines[1:]],
            "a short line": [*lines[:2], ",".join(cells[:-1]), *lines[3:]],
        }
        for at in (0, 1, 2, 4, len(cells) - 1):
            if at < len(cells):
                for entry in ("x", "", "nan", "-1", "7", "6"):
                    wrong[f"{entry!r} at {at}"] = [
                        *lines[:2],
                        ",".join([*cells[:at], entry, *cells[at + 1 :]]),
                        *lines[3:],
                    ]
        for kind, content in wrong.items():
            path.write_text("\n".join(content) + "\n")
            told[f"{name}, {kind}"] = said(reader, folder)
        path.write_text("\n".join(lines) + "\n")
    older = [line.rpartition(",")[0] for line in (folder / "contour.csv").read_text().splitlines()]
    for columns in (3, 2):
        (folder / "contour.csv").write_text("\n".join(older) + "\n")
        rows = read_contour(folder / "contour.csv")
        told[f"contour of {columns} columns"] = [rows.sigma_m.shape, rows.known.sum()]
        older = [line.rpartition(",")[0] for line in older]
    told["tum"] = tum_text([1.5 * n for n in range(COUNT)], poses()).splitlines()
    for key in ("method", "seed", "dimension", "status", "steps", "loops"):
        content = json.loads((folder / "slam.json").read_text())
        del content[key]
        other = tmp_path / key
        written(other, 2)
        (other / "slam.json").write_text(json.dumps(content))
        told[f"without {key}"] = said(lambda other=other: read_results(other).status, other)
    assert_baseline("evaluation/tables", told)
