"""A hand's own folder against the rig file: another side, other fingers, another motor map."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from drivers.core.errors import ConfigurationError
from drivers.shadow.model.hand_info import check_map, check_modelled, load_infos

FIVE = ["th", "ff", "mf", "rf", "lf"]


def folder(root: Path, side: str = "right", fingers: list[str] = FIVE, mapping: str = "rh_E_v1.yaml") -> Path:
    """A configuration folder as Shadow publishes them; its calibration's path."""
    place = {"package_name": "sr_edc_launch", "relative_path": f"mappings/default_mappings/{mapping}"}
    content = {"side": side, "type": "hand_e", "version": "E3M5", "fingers": fingers, "mapping_path": place}
    (root / "general_info.yaml").write_text(yaml.safe_dump(content))
    return root / "calibration.yaml"


def test_a_right_hand_with_its_own_map_is_taken_and_a_folder_that_says_nothing_too(tmp_path: Path) -> None:
    assert load_infos([tmp_path / "calibration.yaml"]) == {}
    motors, infos = Path("maps/rh_E_v1.yaml"), load_infos([folder(tmp_path)])
    check_map(motors, infos)
    check_modelled(motors, infos)
    check_map(Path("maps/motors.yaml"), infos)
    check_modelled(Path("maps/motors.yaml"), {})


@pytest.mark.parametrize("motors", ["rh_E_v3.yaml", "lh_E_v5.yaml"])
def test_a_motor_map_of_another_hand_is_refused_with_the_right_one(tmp_path: Path, motors: str) -> None:
    infos = load_infos([folder(tmp_path)])
    words = rf"general_info.yaml: says that the hand's motor map is rh_E_v1.yaml, but the rig names {motors}"
    with pytest.raises(ConfigurationError, match=words):
        check_map(Path(motors), infos)


def test_a_left_hand_is_not_taken_for_a_right_one(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"general_info.yaml: is of a left hand, whose contacts would be mirr"):
        check_modelled(Path("motors.yaml"), load_infos([folder(tmp_path, side="left")]))
    with pytest.raises(ConfigurationError, match=r"lh_E_v5.yaml: is of a left hand"):
        check_modelled(Path("lh_E_v5.yaml"), {})


def test_a_hand_with_fewer_fingers_is_named_by_what_it_misses(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"is of a hand without MF, LF"):
        check_modelled(Path("motors.yaml"), load_infos([folder(tmp_path, fingers=["th", "ff", "rf"])]))


def test_a_folder_with_a_typing_error_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"general_info.yaml: side"):
        load_infos([folder(tmp_path, side="rihgt")])
