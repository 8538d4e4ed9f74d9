"""A session as a LeRobotDataset, read by PyArrow and OpenCV, and by the package ``lerobot`` where it is installed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pyarrow import parquet

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import SessionError
from drivers.shadow.model.motors import MotorMap
from tactile_lab.viewers.items import ObjectPose, Surface, Touches
from tactile_lab.viewers.lerobot.dataset import CAMERA, Label, write_lerobot
from tactile_lab.viewers.lerobot.features import SURFACE_POINTS
from tactile_lab.viewers.lerobot.sampling import CARRY, PHASES, REACH, Moment
from tests.support import told_session

FRAMES, PICTURE_FROM, ESTIMATE_FROM = 12, 3, 6
COUNTS = {"PDC": 7, "E1": None}


def picture(level: int) -> bytes:
    """A grey PNG of even size."""
    return cv2.imencode(".png", np.full((48, 64, 3), level, np.uint8))[1].tobytes()


@dataclass
class ToldMoments:
    """Stands for a sampled session: nothing is known at first, then a grasp, an estimate and pictures."""

    pictures: bool = True
    has_truth: bool = True
    fingers: tuple[str, ...] = ("FF", "MF", "TH")
    forces: tuple[str, ...] = ("FF", "TH")
    channels: dict[str, tuple[str, ...]] = field(default_factory=lambda: {"MF": tuple(COUNTS)})
    torn: bool = False

    def __post_init__(self) -> None:
        self.robot, self.motors = told_session.robot(), MotorMap.load()
        told = told_session.items(self.robot)
        self.touches = next(one for one in told if isinstance(one, Touches))
        self.surface = next(one for one in told if isinstance(one, Surface))
        self.estimate, self.truth = (next(one for one in told if isinstance(one, ObjectPose) and one.true is true)
                                     for true in (False, True))  # fmt: skip
        self.picture = picture(200)

    def __iter__(self) -> Iterator[Moment]:
        for number in range(FRAMES):
            if self.torn and number == 5:
                raise SessionError("cannot be read", where="traffic.mcap")
            yield self.moment(number)

    def moment(self, number: int) -> Moment:
        joints, base = told_session.posture(seed=number)
        felt = number >= ESTIMATE_FROM
        return Moment(
            stamp_ns=number * NANOSECONDS // 10,
            positions=self.robot.positions(joints, base),
            demands=np.arange(20.0) * number,
            wrenches={"TH": np.arange(6.0) + number},
            loads_N={"FF": 0.5, "MF": np.inf, "TH": 0.25},
            counts={"MF": COUNTS},
            phase=CARRY if felt else REACH,
            touches=self.touches if felt else None,
            grasps=int(felt),
            estimate=self.estimate if felt else None,
            surface=self.surface if felt else None,
            truth=self.truth,
            picture=self.picture if self.pictures and number >= PICTURE_FROM else None,
        )


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Only to be read."""
    folder = tmp_path_factory.mktemp("lerobot") / "told"
    assert write_lerobot(folder, ToldMoments(), Label("shadow-hand-rh", "touch the box")) == FRAMES
    return folder


@pytest.fixture(scope="module")
def info(dataset: Path) -> dict[str, Any]:
    return json.loads((dataset / "meta" / "info.json").read_text())


@pytest.fixture(scope="module")
def columns(dataset: Path) -> dict[str, np.ndarray]:
    return {name: np.array(values) for name, values in data(dataset).to_pydict().items()}


def data(folder: Path) -> Any:
    return parquet.read_table(folder / "data" / "chunk-000" / "file-000.parquet")


def video(folder: Path) -> list[np.ndarray]:
    path = folder / "videos" / CAMERA / "chunk-000" / "file-000.mp4"
    reader, found = cv2.VideoCapture(str(path)), []
    assert reader.get(cv2.CAP_PROP_FPS) == 10.0
    while (read := reader.read())[0]:
        found.append(read[1])
    reader.release()
    return found


def test_the_description_names_every_column_with_its_shape(info, columns):
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 10, "shadow-hand-rh")
    assert (info["total_episodes"], info["total_frames"], info["splits"]) == (1, FRAMES, {"train": "0:1"})
    numbers = {key: told for key, told in info["features"].items() if told["dtype"] != "video"}
    assert set(numbers) == set(columns)
    for key, told in numbers.items():
        assert columns[key].shape == ((FRAMES,) if told["shape"] == [1] else (FRAMES, *told["shape"])), key
        if told["names"] is not None and len(told["shape"]) == 1:
            assert len(told["names"]) == told["shape"][0], key
    assert info["features"]["observation.state"]["names"][:4] == ["base_x_m", "base_y_m", "base_z_m", "base_yaw_rad"]


def test_the_action_is_where_the_hand_is_one_frame_later(columns):
    state = columns["observation.state"]
    assert len(np.unique(state, axis=0)) == FRAMES
    np.testing.assert_array_equal(columns["action"][:-1], state[1:])
    np.testing.assert_array_equal(columns["action"][-1], state[-1])
    np.testing.assert_array_equal(columns["motor_demand"][3], np.arange(20.0) * 3)


def test_what_is_not_known_is_zero_and_said_to_be_unknown(columns, info):
    assert not columns["observation.estimate.known"][: ESTIMATE_FROM - 1].any()
    assert not columns["observation.contact"][:ESTIMATE_FROM].any()
    assert columns["observation.wrench"][4].tolist() == [0.0] * 6 + [4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
    assert columns["observation.load"][0].tolist() == [0.5, 0.0, 0.25]
    assert columns["observation.biotac.MF"][0].tolist() == [7.0, 0.0]
    assert all(np.isfinite(values).all() for values in columns.values())


def test_contacts_and_estimates_stand_in_every_later_frame(columns):
    told = ToldMoments()
    contacts = columns["observation.contact"][-1].reshape(3, 8)
    first = told.touches.touches[0]
    np.testing.assert_allclose(contacts[0], [1, *first.point_world_m, *first.normal_world, first.force_N], atol=1e-7)
    assert contacts[:, 0].tolist() == [1.0, 1.0, 1.0]
    np.testing.assert_allclose(columns["observation.estimate.pose"][-1][:3], [0.01, 0.02, 0.03], atol=1e-7)
    np.testing.assert_allclose(columns["observation.estimate.pose_sigma"][-1], [1e-3, 2e-3, 0, 0, 0, 1e-2], atol=1e-7)
    points = columns["observation.estimate.surface"][-1]
    assert points.shape == (SURFACE_POINTS, 4)
    assert (points[:, :3].sum(axis=1) <= 0.05 + 1e-6).all()  # on the tetrahedron
    assert 0.0 < points[:, 3].min() < points[:, 3].max() < 0.02
    assert columns["truth.object_pose"][0].tolist() == pytest.approx([0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 1.0])
    assert columns["subtask_index"].tolist() == [0] * ESTIMATE_FROM + [PHASES.index(CARRY)] * (FRAMES - ESTIMATE_FROM)


def test_the_video_has_a_frame_for_every_row_black_before_the_first_picture(dataset, info):
    frames = video(dataset)
    assert len(frames) == FRAMES
    assert [round(float(frame.mean()) / 100) for frame in frames] == [0] * PICTURE_FROM + [2] * (FRAMES - PICTURE_FROM)
    told = info["features"][CAMERA]
    assert (told["shape"], told["info"]["video.codec"], told["info"]["video.fps"]) == ([48, 64, 3], "vp9", 10)
    statistics = json.loads((dataset / "meta" / "stats.json").read_text())[CAMERA]
    assert np.ravel(statistics["mean"]) == pytest.approx([200 / 255 * 9 / 12] * 3)
    assert np.shape(statistics["q50"]) == (3, 1, 1)
    assert (np.ravel(statistics["min"]).tolist(), statistics["count"]) == ([0.0] * 3, [FRAMES])


def test_statistics_are_those_of_the_columns(dataset, columns):
    statistics = json.loads((dataset / "meta" / "stats.json").read_text())
    assert set(statistics) == {*columns, CAMERA}
    told = statistics["observation.state"]
    np.testing.assert_allclose(told["mean"], columns["observation.state"].mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(told["q90"], np.quantile(columns["observation.state"], 0.9, axis=0), atol=1e-6)
    assert told["count"] == [FRAMES]
    episode = parquet.read_table(dataset / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()[0]
    assert episode["stats/observation.state/std"] == pytest.approx(told["std"])
    assert (episode["length"], episode["dataset_to_index"], episode["tasks"]) == (FRAMES, FRAMES, ["touch the box"])
    assert episode[f"videos/{CAMERA}/to_timestamp"] == pytest.approx(FRAMES / 10)


def test_a_session_without_pictures_or_truth_has_neither(tmp_path):
    write_lerobot(tmp_path / "told", ToldMoments(pictures=False, has_truth=False), Label("hand", "touch"))
    info = json.loads((tmp_path / "told" / "meta" / "info.json").read_text())
    assert info["video_path"] is None
    assert not {CAMERA, "truth.object_pose"} & set(info["features"])
    assert not (tmp_path / "told" / "videos").exists()


def test_nothing_is_left_of_a_dataset_that_cannot_be_completed(tmp_path):
    with pytest.raises(SessionError, match="cannot be read"):
        write_lerobot(tmp_path / "torn", ToldMoments(torn=True), Label("hand", "touch"))
    (tmp_path / "there").mkdir()
    with pytest.raises(SessionError, match="exists already"):
        write_lerobot(tmp_path / "there", ToldMoments(), Label("hand", "touch"))
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


def test_lerobot_loads_it(dataset, columns, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    reason = "the package lerobot is not installed"
    module = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason=reason, exc_type=ImportError)
    monkeypatch.setattr("tqdm.tqdm.monitor_interval", 0)  # its bars leave a thread behind
    loaded = module.LeRobotDataset("tactile-lab/told", root=dataset, delta_timestamps={"action": [0.0, 0.1]})
    assert (len(loaded), loaded.num_episodes, loaded.meta.robot_type) == (FRAMES, 1, "shadow-hand-rh")
    row = loaded.hf_dataset[FRAMES - 1]
    np.testing.assert_array_equal(row["observation.state"].numpy(), columns["observation.state"][-1].astype(np.float32))
    assert tuple(row["observation.estimate.surface"].shape) == (SURFACE_POINTS, 4)
    assert loaded.meta.get_task_index("touch the box") == 0
    assert np.shape(loaded.meta.stats[CAMERA]["mean"]) == (3, 1, 1)
    if hasattr(__import__("torchvision").io, "VideoReader") or pytest.importorskip("torchcodec"):
        assert abs(float(loaded[FRAMES - 1][CAMERA].mean()) - 200 / 255) < 0.02
        assert loaded[0]["task"] == "touch the box"
