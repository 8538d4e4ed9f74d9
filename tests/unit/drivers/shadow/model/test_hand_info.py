"""Which hand it is: its own folder, its motor map and the rig file, where they agree and where they contradict."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.core.errors import ConfigurationError
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.hand_info import HandStatement, check_map, load_infos, stated_form, stated_serial
from drivers.shadow.protocol.palm_images import Side
from tests.support.hand_folders import FOLDERS, FULL_RIGHT, HandFolder, write_folder

RIG = "rig.yaml: hand"
LITE = next(kind for kind in FOLDERS if kind.name == "rh_lite_v1")


def form_of(folder: HandFolder, side: Side | None = None, fingers: tuple[str, ...] | None = None) -> HandForm:
    """What all files of a folder, and a rig file, tell together."""
    return stated_form(folder.motors, load_infos([folder.joints]), HandStatement(RIG, side, fingers))


def test_the_simulated_hand_is_a_right_one_unless_the_rig_says_otherwise(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, FULL_RIGHT)
    folder.info.unlink()
    assert form_of(folder) == RIGHT_HAND
    folder.motors.rename(anonymous := tmp_path / "motors.yaml")
    assert stated_form(anonymous, {}, HandStatement(RIG, "left")).is_left


@pytest.mark.parametrize("kind", FOLDERS, ids=lambda kind: kind.name)
def test_side_and_fingers_come_from_the_hands_own_files(tmp_path: Path, kind: HandFolder) -> None:
    form = form_of(write_folder(tmp_path, kind))
    assert (form.side, form.fingers) == (kind.side, kind.fingers)
    assert form.mirrored.side != form.side
    assert all(joint[:2] in (*form.fingers, "WR") for joint in form.joints)


def test_the_file_lies_above_the_calibration_in_published_folders(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, FULL_RIGHT)
    assert list(load_infos([folder.joints, folder.gains])) == [folder.info]
    assert load_infos([tmp_path.parent / "calibration.yaml"]) == {}


@pytest.mark.parametrize(
    ("motors", "remedy"),
    [
        ("rh_E_v4.yaml", "Set calibration.motors to rh_E_v3.yaml"),
        ("lh_E_v5.yaml", "Name the files of the connected hand, and its side"),
    ],
)
def test_a_motor_map_of_another_hand_is_refused(tmp_path: Path, motors: str, remedy: str) -> None:
    infos = load_infos([write_folder(tmp_path, FULL_RIGHT).joints])
    words = rf"general_info.yaml: says that the hand's motor map is rh_E_v3.yaml, but the rig names {motors}. {remedy}"
    with pytest.raises(ConfigurationError, match=words):
        check_map(Path(motors), infos)
    check_map(Path("motors.yaml"), infos)


def test_a_left_hand_is_not_taken_for_a_right_one(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, FULL_RIGHT)
    with pytest.raises(ConfigurationError, match=r"info.yaml: is of a right hand, but rig.yaml: hand of a left"):
        form_of(folder, "left")
    folder.motors.rename(left := folder.motors.with_name("lh_E_v3.yaml"))
    with pytest.raises(ConfigurationError, match=r"info.yaml: is of a right hand, but .*lh_E_v3.yaml of a left"):
        stated_form(left, load_infos([folder.joints]), HandStatement(RIG))


def test_fingers_that_the_motor_map_does_not_drive_are_told(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, LITE)
    with pytest.raises(ConfigurationError, match=r"rig.yaml: hand: says that the hand's fingers are FF, MF, RF, LF"):
        form_of(folder, fingers=RIGHT_HAND.fingers)
    folder.info.write_text(folder.info.read_text().replace("- rf\n", ""))
    with pytest.raises(ConfigurationError, match=r"says that the hand's fingers are FF, MF, TH, but .* for FF, MF, RF"):
        form_of(folder)


@pytest.mark.parametrize("line", ["fingers: False", "fingers: false", "name: an_old_folder"])
@pytest.mark.parametrize("kind", [FULL_RIGHT, LITE], ids=lambda kind: kind.name)
def test_a_folder_that_states_no_fingers_leaves_them_to_the_motor_map(
    tmp_path: Path, kind: HandFolder, line: str
) -> None:
    folder = write_folder(tmp_path, kind)
    folder.info.write_text(f"side: right\n{line}\nsensors: {{tip: {{}}}}\n")
    assert form_of(folder).fingers == kind.fingers


@pytest.mark.parametrize("side", ["left", "right"])
def test_maps_of_lite_hands_serve_both_sides(tmp_path: Path, side: Side) -> None:
    """There is none beginning with lh_: the folder of left hand 4138 names rh_lite_v1."""
    folder = write_folder(tmp_path, LITE)
    folder.info.write_text(folder.info.read_text().replace("right", side))
    check_map(folder.motors, load_infos([folder.joints]))
    assert form_of(folder) == HandForm(side, form_of(folder).driven)


def test_a_folder_with_a_typing_error_is_named(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, FULL_RIGHT)
    folder.info.write_text(folder.info.read_text().replace("right", "rihgt"))
    with pytest.raises(ConfigurationError, match=r"general_info.yaml: side"):
        load_infos([folder.joints])


def test_the_name_of_shadows_folder_is_the_serial_number(tmp_path: Path) -> None:
    places = [write_folder(tmp_path / name, FULL_RIGHT).info for name in ("378", "2106")]
    assert stated_serial(places[:1]) == 378
    assert stated_serial([tmp_path / "my-hand" / "general_info.yaml"]) is None
    with pytest.raises(ConfigurationError, match=r"belongs to hand 378, but other files of the rig to hand 2106"):
        stated_serial(places)
