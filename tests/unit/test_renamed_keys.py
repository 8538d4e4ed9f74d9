"""Files that use the keys of the version before are read, and people are told what the keys are called now."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import pytest
import yaml

from drivers.core.configuration import RenamedKeyWarning, load_model, recorded_keys, validate
from drivers.core.errors import ConfigurationError
from tactile_lab.cli.main import main
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.tracking.contacts.motion import MotionNoise

SHIPPED = Path(__file__).resolve().parents[2] / "tactile_lab" / "rigs"
FORMER = {"installation: ": "station: ", "unheld: ": "left_lying: "}


def former_rig(folder: Path) -> Path:
    """The simulated rig as its file was written before, beside its calibrations."""
    text = (SHIPPED / "sim.yaml").read_text()
    for new, old in FORMER.items():
        assert new in text
        text = text.replace(new, old)
    (folder / "calibrations").symlink_to(SHIPPED / "calibrations")
    (folder / "former.yaml").write_text(text)
    return folder / "former.yaml"


def test_a_rig_file_of_the_version_before_is_the_same_rig(tmp_path: Path) -> None:
    path = former_rig(tmp_path)
    with pytest.warns(RenamedKeyWarning) as told:
        rig = load_rig(str(path))
    assert rig.description.model_dump() == load_rig("sim").description.model_dump()
    words = [str(warning.message) for warning in told]
    assert f"{path}: station is now called installation" in words
    assert f"{path}: left_lying is now called unheld" in words


@pytest.mark.filterwarnings("default::drivers.core.configuration.RenamedKeyWarning")
def test_the_command_line_tells_it_in_one_line_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["rig", "show", str(former_rig(tmp_path))])
    assert ended.value.code == 0
    shown = " ".join(capsys.readouterr().err.split())
    assert "warning: " in shown
    assert "station is now called installation" in shown
    assert "Warning(" not in shown


def test_both_names_at_once_are_refused_with_both(tmp_path: Path) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text(yaml.safe_dump({"unheld": 0.2, "left_lying": 0.3}))
    with pytest.raises(ConfigurationError, match="left_lying is the former name of unheld: remove left_lying"):
        load_model(path, MotionNoise)


def test_keys_without_a_meaning_any_more_are_left_out_and_told() -> None:
    class Newer(MotionNoise):
        retired: ClassVar[Mapping[str, str]] = {"wobble": "unheld takes its place"}

    with pytest.warns(RenamedKeyWarning, match="test: wobble no longer has any effect: unheld takes its place"):
        assert validate({"wobble": 3, "unheld": 0.5}, Newer, where="test").unheld == 0.5


def test_recordings_are_read_without_a_word() -> None:
    with recorded_keys():
        assert validate({"left_lying": 0.5}, MotionNoise, where="test").unheld == 0.5
