"""Every page of ``docs/extending.md``, done as it says, from outside the packages."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from drivers.core.configuration import validate
from drivers.core.errors import ConfigurationError
from drivers.core.extensions import load_extension, unload_extension
from drivers.shadow.closing.posture import HandShape
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from tactile_lab.autonomy.autonomous_roles import planner_for
from tactile_lab.autonomy.estimator_process import EstimatorProcess
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.cli.app import app
from tactile_lab.evaluation.files.tables import read_contour
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.extending_page import PAGE, Written, files, rig_keys
from tests.support.low_rig import SHIPPED, low_rig

TIPS = SHIPPED / "calibrations" / "simulated-hand" / "fingertips.yaml"
QUICK = {"conductor": {"fixed_grasps": 1}}


def tactile_lab(*words: object) -> Result:
    """The command line, in this process."""
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)


def only_session(root: Path) -> Session:
    (folder,) = root.iterdir()
    return Session.open(folder)


def test_the_page_has_one_example_of_each() -> None:
    examples = ["quickest", "circle", "heaviest", "touches", "six_floats", "text_wire", "text_positioner"]
    assert files() == [f"{name}.py" for name in examples]


@pytest.mark.long
def test_a_session_with_a_policy_a_figure_a_shape_model_and_a_command(written: Written, tmp_path: Path) -> None:
    written("quickest.py")
    heaviest, circle, touches = written("heaviest.py"), written("circle.py"), written("touches.py")
    rig, runs = low_rig(tmp_path, QUICK, rig_keys("quickest.py")), tmp_path / "runs"
    keys = yaml.safe_load(rig.read_text())
    keys["conductor"] |= {"fixed_grasps": 1, **rig_keys("quickest.py")["conductor"]}
    rig.write_text(yaml.safe_dump(keys))

    ran = tactile_lab(
        "--extension", heaviest, "run", "--rig", rig, "--grasps", 2, "--out", runs, "--no-input", "--json"
    )
    assert ran.exit_code == 0, ran.stderr
    session = only_session(runs)
    messages = session.traffic().messages()
    decisions = [json.loads(message.data) for message in messages if message.topic == schemas.DECISION_TOPIC]
    chosen = decisions[0]
    times_s = [candidate["time_s"] for candidate in chosen["candidates"]]
    assert {decision["policy"] for decision in decisions} == {"quickest"}
    assert times_s[chosen["chosen"]] == min(times_s)
    assert session.manifest.calibration["extension-quickest"].file == "extension-quickest.py"

    told = json.loads(ran.stdout)
    assert 0.05 < told["further"]["heaviest_touch_n"] < 17.0
    assert "heaviest_touch_n" in (session.results / "report.html").read_text()

    out = tmp_path / "round"
    made = tactile_lab("--extension", circle, "reconstruct", session.folder, "--shape", "circle", "--out", out)
    assert made.exit_code == 0, made.stderr
    outline_m = read_contour(out / "contour.csv").points_m
    distances_m = np.linalg.norm(outline_m - outline_m.mean(axis=0), axis=1)
    assert np.ptp(distances_m) < 1e-6
    assert 0.03 < distances_m[0] < 0.06  # of a block of 100 x 60 mm

    listed = tactile_lab("--extension", touches, "touches", session.folder)
    assert listed.exit_code == 0
    assert [line.split(":")[0] for line in listed.stdout.splitlines()] == ["grasp 1", "grasp 2"]
    assert "touches" in tactile_lab("--extension", touches, "--help").stdout


def test_a_policy_plans_in_the_process_of_a_session_on_wires(written: Written, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(PAGE.parents[1]))
    load_extension(written("quickest.py"))
    content = {"exploration": {"policy": "quickest"}, "fixed_grasps": 1}
    settings = validate(content, SessionSettings, where="test")
    slam = TactileSlam(SlamSettings(), seed=1)
    service = SlamService(slam, planner_for(slam, settings, HandShape(), 0, 2))
    with EstimatorProcess(service, lambda: None) as elsewhere:
        assert elsewhere.ask(SlamService.plan, 0).plan == service.plan(0).plan


@pytest.mark.long
def test_a_session_with_fingertips_and_a_positioner_of_its_own(written: Written, tmp_path: Path) -> None:
    rig_extensions = [written("six_floats.py"), written("text_positioner.py")]
    rig = low_rig(tmp_path, rig_keys("six_floats.py"), rig_keys("text_positioner.py"))
    runs = tmp_path / "runs"

    shown = json.loads(tactile_lab("rig", "show", rig, "--json").stdout)
    assert (shown["six-floats"]["contact_force_N"], shown["base"]["speed_m_s"]) == (0.06, 0.3)
    checked = tactile_lab("rig", "check", rig, "--json")
    assert checked.exit_code == 0, checked.stdout
    tips = [one for one in json.loads(checked.stdout)["devices"] if one["device"].startswith("fingertip")]
    assert len(tips) == 5
    assert all(one["figures"]["noise_mN"] < 6.0 for one in tips)

    ran = tactile_lab("run", "--rig", rig, "--grasps", 2, "--out", runs, "--no-input", "--json")
    assert ran.exit_code == 0, ran.stderr
    assert json.loads(ran.stdout)["contacts"] >= 6
    session = only_session(runs)
    first = {message.topic: message.data for message in reversed(list(session.traffic().messages()))}
    assert {schemas.received_transport(topic) for topic in first} >= {"base", "ft/FF"}

    for path in rig_extensions:
        unload_extension(path)
    with pytest.raises(ConfigurationError, match=r"there is no fingertip kind 'six-floats'.*--extension .*six-floats"):
        tactile_lab("session", "replay", session.folder)
    kept = [session.calibration_file(f"extension-{path.stem}") for path in rig_extensions]
    loaded = [word for path in kept for word in ("--extension", path)]
    replayed = tactile_lab(*loaded, "session", "replay", session.folder, "--json")
    for path in kept:
        unload_extension(path)
    assert replayed.exit_code == 0, replayed.stderr
    assert json.loads(replayed.stdout)["identical"]


@contextmanager
def text_program(port: int) -> Iterator[None]:
    """Sends lines of six readings to whoever asks, until told to stop."""
    done = threading.Event()

    def serve() -> None:
        client, count = None, 0
        while not done.is_set():
            try:
                asked, client_now = wire.recvfrom(100)
                client = client_now if asked == b"start\n" else None
            except TimeoutError:
                pass
            if client is not None:
                count += 1
                noise = 1e-4 * (count % 7)
                wire.sendto(f"{count} {noise} 0.1 -0.2 0.001 0 {noise / 100}\n".encode(), client)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", port))
        wire.settimeout(0.005)
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()


def test_a_sensor_on_a_wire_of_its_own(written: Written, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    wires = {"FF": {"wire": "text-udp", "host": "127.0.0.1", "port": port}}
    content = {"name": "bench", "summary": "One sensor", "kind": "fingertips", "calibration": str(TIPS), "wires": wires}
    rig = tmp_path / "bench.yaml"
    rig.write_text(yaml.safe_dump({**content, "nano17": {"silent_ms": 5000}}))
    extension = written("text_wire.py")
    with text_program(port):
        checked = tactile_lab("--extension", extension, "rig", "check", rig, "--json")
    devices = {one["device"]: one for one in json.loads(checked.stdout)["devices"]}
    finger = devices["fingertip FF"]
    assert finger["ok"], finger
    assert finger["detail"].startswith(f"the text program at 127.0.0.1:{port}")
    assert finger["figures"]["bias_N"] == pytest.approx(0.2)
    assert finger["figures"]["lost"] == 0
