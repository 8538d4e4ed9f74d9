"""Where results are to be written: a place that cannot be is told before anything is loaded, started or measured."""

from __future__ import annotations

import pytest

OUTPUTS = {
    "run": "--out",
    "sweep": "--out",
    "ros2-bridge": "--out",
    "evaluate SESSION": "--out",
    "reconstruct SESSION": "--out",
    "session replay SESSION": "--into",
    "session extract SESSION": "--into",
    "session catalogue": "--out",
    "model export SESSION": "--out",
    "markers single": "--out",
    "experiment table-4.2": "--out --parquet",
    "calibrate forearm": "--out --record",
    "calibrate camera 0": "--out",
    "calibrate fingertip": "--out --record",
    "calibrate joints": "--out --record",
    "session import contacts.csv": "--out",
    "calibrate biotac presses.csv": "--out",
    "session export SESSION": "--contacts --csv --hdf5 --parquet --lerobot --rosbag --foxglove --rerun --tum --archive",
}


@pytest.mark.parametrize(
    ("words", "option"), [(words, option) for words, options in OUTPUTS.items() for option in options.split()]
)
def test_a_place_inside_of_a_file_is_refused(inside, tmp_path, words, option):
    (tmp_path / "file").touch()
    answer = inside(*words.split(), option, tmp_path / "file" / "below")
    assert answer.code == 2
    assert "file is not a folder" in " ".join(answer.err.replace("│", "").split())
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]
