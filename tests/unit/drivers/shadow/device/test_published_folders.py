"""Folders of hands as Shadow publishes them: which files are the hand's own, and what the table says of each hand.

All hands of a checkout: ``python -m tests.support.published_hands_table``.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from tests.support.emulated_hands import EmulatedBench
from tests.support.hand_folders import FOLDERS, FULL_RIGHT, HandFolder, write_folder
from tests.support.published_hands_table import outcome, published_folders, published_setup, rows

LITE, LEFT_LITE = (kind for kind in FOLDERS if kind.name == "rh_lite_v1")


def publish(root: Path, name: str, kind: HandFolder) -> HandFolder:
    """Write a hand's folder below ``config``, and its motor map into ``maps``."""
    folder = write_folder(root / "config" / name, kind)
    maps = root / "maps"
    maps.mkdir(exist_ok=True)
    folder.motors.rename(maps / folder.motors.name)
    return folder


def test_every_hand_is_in_the_table_by_its_serial_number(tmp_path: Path) -> None:
    publish(tmp_path, "2106", FULL_RIGHT)
    publish(tmp_path, "378", LEFT_LITE)
    broken = publish(tmp_path, "1130", LITE)
    broken.joints.write_text(broken.joints.read_text().replace("FFJ3", "FFJ33"))
    publish(tmp_path, "634", FULL_RIGHT).info.unlink()

    folders, maps = published_folders([tmp_path / "config"]), tmp_path / "maps"
    assert [folder.name for folder in folders] == ["378", "634", "1130", "2106"]
    told = rows(folders, maps)
    assert told["right, 5 fingers", "rh_E_v3", "moved"] == ["2106"]
    assert told["left, 4 fingers", "rh_lite_v1", "moved"] == ["378"]
    assert told["not readable", "", "general_info.yaml: file not found. Check the path"] == ["634"]
    (reason,) = (words for _, _, words in told if "FFJ33" in words)
    assert reason.startswith("calibrations/calibration.yaml: misses FFJ3")


def test_a_template_inside_a_hands_folder_is_neither_a_hand_nor_its_files(tmp_path: Path) -> None:
    """As in published folders 1066 and 2346: the template names another motor map."""
    hand = publish(tmp_path, "2346", next(kind for kind in FOLDERS if kind.name == "lh_E_v3"))
    publish(tmp_path, "2346/Template_EL", next(kind for kind in FOLDERS if kind.name == "lh_E_v5"))
    shutil.rmtree(hand.gains.parent)
    assert published_folders([tmp_path / "config"]) == [hand.root]
    setup = published_setup(hand.root, tmp_path / "maps")
    assert (setup.joints, setup.gains) == (hand.joints, None)
    EmulatedBench(setup, 2346)


def test_published_folders_that_are_at_hand_move_or_are_refused_with_the_defect(lab_data: Path) -> None:
    maps, folders = lab_data / "shadow_motor_maps", published_folders([lab_data / "shadow_hand_config"])
    told = {folder: outcome(folder, maps) for folder in folders}
    assert told
    for folder, words in told.items():
        if folder.name in DEFECTIVE:
            assert f"{folder.name}/" in words
            assert "calibration.yaml" in words
        else:
            assert words == NOT_ALL_DRIVEN.get(folder.name, "moved"), folder


DEFECTIVE = {"111", "112", "113", "114", "362", "6282", "6458", "6522", "8458", "5754"}
"""Serial numbers of the published hands whose calibration is defective itself."""

NOT_ALL_DRIVEN = {"554": "moved; not to be driven: LFJ0, THJ1"}
"""Hands with motors that their own gains do not drive."""
