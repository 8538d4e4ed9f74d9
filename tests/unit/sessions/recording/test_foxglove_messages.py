"""What viewers show: the camera's calibration, arrows of contacts and points, as Foxglove's schemas have them."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from drivers.core.contacts import Contact
from sessions.recording.traffic import foxglove

STAMP_ns = 3_000_000_007


@pytest.mark.parametrize(("count", "model"), [(5, "plumb_bob"), (8, "rational_polynomial")])
def test_a_wide_picture_is_wide_and_its_matrix_stands_in_k_and_p(count: int, model: str) -> None:
    matrix = np.array([[600.0, 0.0, 320.0], [0.0, 601.0, 240.0], [0.0, 0.0, 1.0]])
    told = foxglove.camera_calibration(STAMP_ns, matrix, [0.1] * count, (640, 480))
    assert (told["width"], told["height"], told["distortion_model"]) == (640, 480, model)
    assert told["timestamp"] == {"sec": 3, "nsec": 7}
    np.testing.assert_array_equal(np.reshape(told["K"], (3, 3)), matrix)
    np.testing.assert_array_equal(np.reshape(told["P"], (3, 4)), np.hstack([matrix, np.zeros((3, 1))]))
    np.testing.assert_array_equal(np.reshape(told["R"], (3, 3)), np.eye(3))
    assert len(told["D"]) == count


def contact(normal: tuple[float, float, float]) -> Contact:
    return Contact("FF", np.array([0.1, 0.2, 0.3]), np.array(normal), 1e-6 * np.eye(3), 0.1, 2.5)


@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
def test_an_arrow_points_along_the_contact_s_normal(normal: tuple[float, float, float]) -> None:
    scene = foxglove.contact_scene(STAMP_ns, 4, [contact(normal)])
    (entity,) = scene["entities"]
    assert entity["id"] == "grasp-4"
    (arrow,) = entity["arrows"]
    turn = arrow["pose"]["orientation"]
    x, y, z, w = (turn[axis] for axis in "xyzw")
    along = [
        1 - 2 * (y * y + z * z),
        2 * (x * y + z * w),
        2 * (x * z - y * w),
    ]  # of the quaternion's matrix, first column
    np.testing.assert_allclose(along, normal, atol=1e-9)
    assert arrow["pose"]["position"] == pytest.approx({"x": 0.1, "y": 0.2, "z": 0.3})
    assert arrow["shaft_length"] + arrow["head_length"] == pytest.approx(foxglove.ARROW_LENGTH_m)


def test_contacts_as_points_have_place_normal_and_force_in_each_row() -> None:
    cloud = foxglove.contact_cloud(STAMP_ns, [contact((1.0, 0.0, 0.0)), contact((0.0, 0.0, 1.0))])
    table = np.frombuffer(base64.b64decode(cloud["data"]), "<f8").reshape(2, -1)
    assert cloud["point_stride"] == 8 * table.shape[1]
    assert [field["name"] for field in cloud["fields"]] == [
        "x",
        "y",
        "z",
        "normal_x",
        "normal_y",
        "normal_z",
        "force_N",
    ]
    assert [field["offset"] for field in cloud["fields"]] == [8 * column for column in range(7)]
    np.testing.assert_allclose(table[1], [0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 2.5])
