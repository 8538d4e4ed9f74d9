"""BioTacs in the palm's tactile section of every kind of palm: plant, shared memory, EtherCAT, driver, contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from drivers.biotac.biotac import BioTac, load_biotacs
from drivers.core.clock import VirtualClock
from drivers.core.contacts import FINGERS, Array
from drivers.emulators.ethercat.shadow_chain import ChainSettings, emulated_hand
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_images import PalmName
from drivers.simulation.devices.biotac_emulator import BiotacSection
from drivers.simulation.hand_plant import TrueContact
from drivers.simulation.settings import BiotacSettings
from tactile_lab import rigs
from tactile_lab.rigs.build import build_interpreter, check_calibration
from tactile_lab.rigs.description import load_rig
from tactile_lab.rigs.wired import emulation_plan, hand_setup
from tests.support.memory_port import MemoryPort

FOLDER = Path(rigs.__file__).parent / "calibrations" / "simulated-hand"
JOINTS, TIPS = JointCalibration.load(FOLDER / "joints.yaml"), load_biotacs(FOLDER / "biotacs.yaml")
CYCLE_ns, UPRIGHT = 2_000_000, np.eye(3)


class Touched:
    """A hand whose fingertips are touched as the plant's memory says."""

    def __init__(self, folder: Path, palm: PalmName) -> None:
        self.clock = VirtualClock()
        self.plant = PlantMirror.create(folder / "plant", self.clock, np.zeros(6))
        rng = np.random.default_rng(0)
        section = BiotacSection.as_calibrated(PlantMirror(folder / "plant", self.clock), TIPS, BiotacSettings(), rng)
        chain = emulated_hand(self.clock, JOINTS, ChainSettings(palm=palm), tactile=section)
        settings = HandSettings(palm=palm, cycle_s=0.002, tactile="biotac", soft_start_s=0.0)
        transport = EthercatTransport("hand", EthercatSettings(interface="memory"), self.clock, MemoryPort(chain.ring))
        self.hand = ShadowHand(transport, self.clock, JOINTS, settings)
        self.tips = {finger: BioTac(finger, TIPS[finger]) for finger in FINGERS}

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.clock.sleep_until_ns(self.clock.now_ns() + CYCLE_ns)
            sample = self.hand.exchange()
            for tip in self.tips.values():
                tip.update(sample)

    def touch(self, finger: str, force_N: float) -> Array:
        """Press the middle of a fingertip's pad, with its distal frame in the world's; the place, metres."""
        skin, mounting = TIPS[finger].skin, TIPS[finger].distal_T_sensor.pose()
        assert skin is not None
        points, normals = skin.surface().project(np.array([[0.001, 0.001, -0.02]]))
        point, into_tip = np.asarray(mounting.transformFrom(points[0])), -(mounting.rotation().matrix() @ normals[0])
        contact = TrueContact(finger, "object", point, into_tip, force_N * into_tip)
        self.plant.publish_touches([contact], [Pose3()] * len(FINGERS))
        return point


def test_a_hand_that_stands_alone_has_untouched_biotacs_when_asked() -> None:
    clock = VirtualClock()
    chain = emulated_hand(clock, JOINTS, ChainSettings(tactile="biotac"))
    transport = EthercatTransport("hand", EthercatSettings(interface="memory"), clock, MemoryPort(chain.ring))
    hand = ShadowHand(transport, clock, JOINTS, HandSettings(cycle_s=0.002, tactile="biotac"))
    tip = BioTac("TH", TIPS["TH"])
    hand.connect()
    for _ in range(300):
        clock.sleep_until_ns(clock.now_ns() + CYCLE_ns)
        tip.update(hand.exchange())
    tip.tare(UPRIGHT)
    assert tip.health() == ()
    assert tip.load_N(UPRIGHT) < 0.3
    hand.close()


@pytest.mark.parametrize("palm", ["0220", "0230", "0240"])
def test_a_touch_in_the_plant_is_felt_through_the_palm(tmp_path: Path, palm: PalmName) -> None:
    runtime = Touched(tmp_path, palm)
    runtime.hand.connect()
    runtime.cycles(300)
    for tip in runtime.tips.values():
        tip.tare(UPRIGHT)
    place = runtime.touch("MF", 1.0)
    runtime.cycles(150)
    runtime.tips["MF"].begin_capture()
    runtime.tips["FF"].begin_capture()
    runtime.cycles(30)
    found = runtime.tips["MF"].contact(UPRIGHT)
    assert found is not None
    assert np.linalg.norm(found.point_distal_m - place) < 0.003
    assert found.force_N > 0.5
    assert runtime.tips["FF"].contact(UPRIGHT) is None
    assert runtime.tips["FF"].health() == ()
    runtime.hand.close()


def test_the_shipped_rig_with_biotacs_on_wires_is_sound() -> None:
    rig = load_rig("sim-wire-biotac")
    check_calibration(rig)
    plan = emulation_plan(rig, 3, "cube-6")
    assert (plan.wires, plan.simulation.fingertips) == ({}, "biotac")
    assert plan.tips == (FOLDER / "biotacs.yaml").resolve()
    assert hand_setup(rig).hand.tactile == "biotac"
    assert set(build_interpreter(rig).perception.fingertips) == set(FINGERS)


def test_of_more_touches_than_the_plants_memory_holds_the_first_are_shown(tmp_path: Path) -> None:
    mirror = PlantMirror.create(tmp_path / "plant", VirtualClock(), np.zeros(6))
    assert mirror.contacts() == ()
    touch = TrueContact("TH", "table", np.ones(3), np.array([0.0, 0.0, 1.0]), np.full(3, 0.5))
    mirror.publish_touches([touch] * 70, [Pose3()] * 5)
    seen = mirror.contacts()
    assert len(seen) == 64
    assert (seen[0].finger, seen[0].touched) == ("TH", "table")
    assert seen[-1].force_on_tip_world_N.tolist() == [0.5] * 3
    mirror.publish_touches([], [Pose3()] * 5)
    assert mirror.contacts() == ()
