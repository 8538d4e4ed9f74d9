"""Rig files that name the wire of each fingertip: emulated, checked, and what is said when something is wrong."""

from __future__ import annotations

import json
import shutil
import socket
from importlib import resources
from pathlib import Path

import pytest
import yaml

from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import load_fingertips
from tactile_lab.rigs.checks.check import check_rig
from tactile_lab.rigs.checks.findings import Finding
from tactile_lab.rigs.description import load_rig
from tactile_lab.rigs.emulate import emulate_sensors, emulated_rig
from tactile_lab.rigs.fingertip_rig import load_fingertip_rig

TIPS = Path(str(resources.files("tactile_lab.rigs"))) / "calibrations" / "simulated-hand" / "fingertips.yaml"


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A rig with a sensor on each kind of wire that can be emulated without an adapter."""
    shutil.copy(TIPS, tmp_path / "tips.yaml")
    content = {
        "name": "bench",
        "summary": "Three fingertips on the bench",
        "kind": "fingertips",
        "calibration": "tips.yaml",
        "nano17": {"silent_ms": 5000},  # a busy machine may hold the emulated units back
        "wires": {
            "FF": {
                "wire": "net-ft",
                "host": "127.0.0.1",
                "port": free_port(socket.SOCK_DGRAM),
                "http_port": free_port(socket.SOCK_STREAM),
                "rate_hz": 500,
                "serial": "FT20001",
            },
            "MF": {"wire": "digital", "port": str(tmp_path / "tty-MF"), "baud": 115200, "parity": "N"},
            "TH": {
                "wire": "controller",
                "port": str(tmp_path / "tty-TH"),
                "baud": 19200,
                "counts_per_N": 320,
                "counts_per_Nm": 64000,
            },
        },
    }
    return write(tmp_path / "bench.yaml", content)


def write(path: Path, content: object) -> Path:
    path.write_text(yaml.safe_dump(content))
    return path


def changed(rig: Path, finger: str, **changes: object) -> Path:
    """The same rig with other words for one wire, in a file beside it."""
    content = yaml.safe_load(rig.read_text())
    content["wires"][finger] |= changes
    return write(rig.with_name("other.yaml"), content)


def found(rig: Path) -> dict[str, Finding]:
    return {finding.device.removeprefix("fingertip "): finding for finding in check_rig(str(rig))}


@pytest.mark.usefixtures("patient")
def test_every_sensor_is_found_and_described(rig: Path) -> None:
    with emulate_sensors(load_fingertip_rig(rig)) as places:
        findings = found(rig)
    assert findings.pop("calibration fingertips").figures["verdict"] == "PASS"
    assert set(places) == set(findings) == {"FF", "MF", "TH"}
    assert all(finding.ok for finding in findings.values()), findings
    assert "FT20001" in findings["FF"].detail
    assert "0 lost" in findings["FF"].detail
    assert "FT00002, calibrated 2026-01-01" in findings["MF"].detail
    assert "samples/s" in findings["TH"].detail
    assert not Path(places["MF"].removeprefix("port ")).is_symlink()  # the made port is taken away again


def test_sensors_that_are_not_there_are_told_each_in_its_words(rig: Path) -> None:
    findings = found(rig)
    del findings["calibration fingertips"]
    assert not any(finding.ok for finding in findings.values())
    assert "no web page from the box" in findings["FF"].detail
    assert "there is no serial port" in findings["MF"].detail
    assert "Plug the adapter in" in findings["TH"].detail


@pytest.mark.long
def test_a_wrong_baud_rate_is_found_out(rig: Path) -> None:
    with emulate_sensors(load_fingertip_rig(rig)):
        digital, controller = (found(changed(rig, finger, baud=baud)) for finger, baud in (("MF", 19200), ("TH", 9600)))
    assert "It answers at 115200 baud: correct wires.MF.baud" in digital["MF"].detail
    assert "It answers at 19200 baud: correct wires.TH.baud" in controller["TH"].detail


@pytest.mark.long
def test_another_sensor_than_the_rig_names_is_found_out(rig: Path) -> None:
    with emulate_sensors(load_fingertip_rig(rig)):
        box, digital = (found(changed(rig, finger, serial="FT77777"))[finger] for finger in ("FF", "MF"))
    assert "the box uses the calibration of FT20001, but the rig file names FT77777" in box.detail
    assert "the sensor is FT00002, but the rig file names FT77777" in digital.detail


def test_a_device_that_is_no_controller_is_told(rig: Path, tmp_path: Path) -> None:
    swapped = changed(rig, "TH", port=str(tmp_path / "tty-MF"))
    content = yaml.safe_load(swapped.read_text())
    del content["wires"]["MF"]
    write(swapped, content)
    with emulate_sensors(load_fingertip_rig(rig)):
        assert "does not answer" in found(swapped)["TH"].detail


@pytest.mark.parametrize(
    ("finger", "changes", "words"),
    [
        ("FF", {"wire": "net-tf"}, ("wires.FF", "net-tf", "net-ft")),
        ("FF", {"rate_hz": 9000}, ("rate_hz", "less than or equal to 7000")),
        ("FF", {"host": 3}, ("host",)),
        ("MF", {"baud": 57600}, ("baud", "1250000")),
        ("MF", {"colour": "red"}, ("colour: unknown key",)),
        ("TH", {"counts_per_N": 0}, ("counts_per_N", "greater than 0")),
    ],
)
def test_a_wire_that_does_not_fit_is_named(
    rig: Path, finger: str, changes: dict[str, object], words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        load_fingertip_rig(changed(rig, finger, **changes))
    assert all(word in str(refusal.value) for word in (*words, "other.yaml"))


def test_two_fingers_on_one_port_are_refused(rig: Path) -> None:
    port = yaml.safe_load(rig.read_text())["wires"]["MF"]["port"]
    with pytest.raises(ConfigurationError, match="MF and TH both use port"):
        load_fingertip_rig(changed(rig, "TH", port=port))


def test_a_finger_without_calibration_is_refused(rig: Path) -> None:
    others = {finger: tip.model_dump(mode="json") for finger, tip in load_fingertips(TIPS).items() if finger != "MF"}
    (rig.parent / "tips.yaml").write_text(yaml.safe_dump({"fingertips": others}))
    with pytest.raises(ConfigurationError, match=r"tips.yaml does not name MF"):
        load_fingertip_rig(rig)


def test_volts_through_a_calibration_in_counts_are_refused(rig: Path, lab_data: Path) -> None:
    shutil.copy(lab_data / "ati_cal" / "FT10484_Net.xml", rig.parent)
    content = yaml.safe_load(rig.read_text())
    content["wires"] = {"FF": {"wire": "gauge-volts", "calibration": "FT10484_Net.xml", "local_port": 40000}}
    with pytest.raises(ConfigurationError, match=r"wires\.FF: the calibration of FT10484 is in counts"):
        check_rig(str(write(rig, content)))


def test_emulated_volts_go_through_the_rigs_own_calibration(rig: Path, lab_data: Path) -> None:
    shutil.copy(lab_data / "ati_cal" / "FT14048.cal", rig.parent)
    content = yaml.safe_load(rig.read_text())
    port = free_port(socket.SOCK_DGRAM)
    content["wires"] = {"FF": {"wire": "gauge-volts", "calibration": "FT14048.cal", "local_port": port}}
    write(rig, content)
    with emulate_sensors(load_fingertip_rig(rig)):
        assert found(rig)["FF"].ok


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"host": "192.168.1.1"}, "only loopback"),
        ({"wire": "can-oem", "interface": "virtual", "channel": "x"}, "exists only inside one program"),
    ],
)
def test_what_cannot_be_emulated_is_told(rig: Path, changes: dict[str, object], words: str) -> None:
    content = yaml.safe_load(rig.read_text())
    content["wires"] = {"FF": changes if "wire" in changes else content["wires"]["FF"] | changes}
    with pytest.raises(ConfigurationError, match=words), emulate_sensors(load_fingertip_rig(write(rig, content))):
        pytest.fail("it was emulated")


@pytest.mark.parametrize("name", ["sim", str(TIPS.parents[2] / "sim-wire.yaml")])
def test_rigs_that_start_what_they_need_are_not_emulated(name: str) -> None:
    with pytest.raises(ConfigurationError, match="simulated and emulated rigs start their emulators"):
        emulated_rig(name)


def test_a_real_port_is_never_replaced(rig: Path) -> None:
    (rig.parent / "tty-MF").write_text("a device")
    with pytest.raises(ConfigurationError, match="tty-MF cannot be emulated"), emulate_sensors(load_fingertip_rig(rig)):
        pytest.fail("it was emulated")
    assert (rig.parent / "tty-MF").read_text() == "a device"


def test_a_session_needs_a_hand(rig: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"bench\.yaml: has only fingertips, and no hand"):
        load_rig(str(rig))


@pytest.mark.usefixtures("patient")
def test_the_command_tells_what_is_wrong_and_ends_with_its_code(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from tactile_lab.cli.main import main

    with pytest.raises(SystemExit) as ended:
        main(["rig", "check", str(rig), "--json"])
    assert ended.value.code == 4
    told = json.loads(capsys.readouterr().out)
    assert not told["ready"]
    names = ["calibration fingertips", "fingertip FF", "fingertip MF", "fingertip TH"]
    assert [device["device"] for device in told["devices"]] == names
    with emulate_sensors(load_fingertip_rig(rig)), pytest.raises(SystemExit) as ended:
        main(["rig", "check", str(rig)])
    assert ended.value.code == 0
    with pytest.raises(SystemExit) as ended:
        main(["rig", "emulate", str(rig), "--seconds", "0.1"])
    assert ended.value.code == 0
    assert "FF: the box at 127.0.0.1" in capsys.readouterr().out
