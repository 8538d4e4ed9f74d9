"""A grasp in the simulated world, recorded, and understood again from its bytes: the same, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.biotac.biotac import BioTac
from drivers.camera.camera import Camera
from drivers.core.clock import VirtualClock
from drivers.core.contacts import FINGERS, Grasp
from drivers.core.transports import ReplayTransport, TappedTransport
from drivers.positioner.positioner import Positioner, mount_joints, mount_T_forearm
from drivers.shadow.closing.closing import closing
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandDecoder
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.model.kinematics import JOINTS, forearm_T_palm
from drivers.simulation.settings import ObjectStart, SimulationSettings
from drivers.simulation.world import SimulatedWorld
from sessions.perception.approach_paths import TipSurface
from sessions.perception.event_outcomes import TruthFrame
from sessions.perception.interpreter import Interpreter, Observer, fingertip_link
from sessions.perception.perception import Perception
from sessions.perception.replay import Replay
from sessions.recording.running_session import create_session
from sessions.rig_runtime.rig_runtime import RigRuntime
from sessions.rig_runtime.sensor_stream import SensorStream

CYCLE_ns = 10_000_000
SETTINGS = Nano17Settings()


def make_interpreter(world):
    known, clock = world.calibration, VirtualClock()
    slots, tips = {}, {}
    if world.settings.fingertips == "nano17":
        tips = {
            finger: Nano17(finger, ReplayTransport(fingertip_link(finger), []), clock, tip, SETTINGS)
            for finger, tip in known.tips["nano17"].items()
        }
    else:
        slots = {finger: BioTac(finger, tip.calibration) for finger, tip in known.tips["biotac"].items()}
    surface = TipSurface.upright((0.0085, 0.0085, 0.013), (0.0, 0.0, 0.019))
    perception = Perception(
        tip_surfaces=dict.fromkeys(FINGERS, surface),
        wrench_fingertips=tips,
        slot_fingertips=slots,
        mount_T_forearm=mount_T_forearm,
        world_T_mount=world.settings.world_T_mount.pose(),
    )
    return Interpreter(
        perception,
        hand=HandDecoder(known.joints),
        base=Positioner(ReplayTransport("base", []), clock),
        wrenches=tips,
        camera=Camera(ReplayTransport("camera", []), clock),
        clock=clock,
    )


def make_runtime(world, recorder):
    observer, known = Observer(recorder, make_interpreter(world)), world.calibration
    transports = {
        name: TappedTransport(transport, observer, world.clock) for name, transport in world.transports().items()
    }
    hand_settings = HandSettings(tactile="biotac" if world.settings.fingertips == "biotac" else "none")
    wrenches = {
        finger: transports[fingertip_link(finger)] for finger in FINGERS if fingertip_link(finger) in transports
    }
    return RigRuntime(
        clock=world.clock,
        cycle_ns=CYCLE_ns,
        hand=ShadowHand(transports["hand"], world.clock, known.joints, hand_settings, known.motors),
        base=Positioner(transports["base"], world.clock),
        observer=observer,
        wrench_devices={
            finger: SensorStream(Nano17(finger, link, world.clock, known.tips["nano17"][finger], SETTINGS), link)
            for finger, link in wrenches.items()
        },
        camera=Camera(transports["camera"], world.clock),
        truth=world.truth,
    )


def close_on_object(runtime, table, stop_N):
    """Every finger goes on along its line until it feels the object."""
    progress = {finger: table.path(finger).valid[0] for finger in FINGERS}
    for _ in range(250):
        loads_N = runtime.perception.loads_N()
        for finger in FINGERS:
            if loads_N[finger] < stop_N:
                progress[finger] += 4e-4 / table.path(finger).length_m
        runtime.hand.set_targets({n: a for f in FINGERS for n, a in table.joints(f, progress[f]).items()})
        runtime.cycle()


def grasp_twice(runtime, stop_N):
    table = closing("pinch", 0.022)
    mount_T_palm = runtime.world_T_mount.inverse() * table.grasp_T_palm
    q = mount_joints(mount_T_palm * forearm_T_palm(np.zeros(len(JOINTS))).inverse(), 0.0)
    runtime.connect()
    opened = {name: a for f in FINGERS for name, a in table.joints(f, table.paths[f].valid[0]).items()}
    runtime.hand.set_targets({**opened, "WRJ1": 0.0, "WRJ2": 0.0})
    runtime.base.set_target(q + np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]))
    runtime.run(1_500_000_000)
    runtime.tare()
    runtime.base.set_target(q)
    runtime.run(600_000_000)
    runtime.begin_closing()
    close_on_object(runtime, table, stop_N)
    grasps = []
    for _ in range(2):
        runtime.begin_capture()
        runtime.run(200_000_000)
        grasps.append(runtime.end_capture())
        runtime.truth_frame()
        runtime.begin_hold()
        runtime.base.set_target(q + np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]))
        runtime.run(200_000_000)
        runtime.end_hold()
    runtime.close()
    return grasps


def bits(grasp):
    """Everything in a grasp, as bytes."""
    contacts = [
        (
            contact.finger,
            contact.point_world_m.tobytes(),
            contact.normal_world.tobytes(),
            contact.point_covariance_m2.tobytes(),
            contact.normal_sigma_rad.hex(),
            contact.force_N.hex(),
        )
        for contact in grasp.contacts
    ]
    ways = [
        (way.finger, way.start_world_m.tobytes(), way.end_world_m.tobytes(), way.touched)
        for way in grasp.approach_paths
    ]
    poses = (grasp.world_T_palm.matrix().tobytes(), grasp.hand_motion_world.matrix().tobytes())
    sigma = grasp.motion_sigma
    noise = None if sigma is None else (sigma.translation_m.hex(), sigma.rotation_rad.hex())
    return grasp.index, grasp.stamp_ns, contacts, ways, poses, noise


@pytest.mark.parametrize(("fingertips", "stop_N"), [("nano17", 0.3), ("biotac", 0.3)])
def test_a_simulated_session_is_understood_the_same_from_its_bytes(tmp_path, fingertips, stop_N):
    start = ObjectStart(x_m=0.0, y_m=0.0, yaw_rad=1.5708)
    world = SimulatedWorld(SimulationSettings(fingertips=fingertips, start=start), seed=4)
    with create_session(tmp_path, rig="sim", rig_description={}, object_name=world.settings.object) as session:
        live = grasp_twice(make_runtime(world, session.recorder), stop_N)
    replay = Replay(session, make_interpreter(world))
    outcomes = list(replay.outcomes())
    assert not replay.loss
    replayed = [outcome for outcome in outcomes if isinstance(outcome, Grasp)]
    assert [bits(grasp) for grasp in replayed] == [bits(grasp) for grasp in live]
    assert len(live[0].contacts) >= 3
    assert {way.finger for way in live[0].approach_paths if way.touched} <= {one.finger for one in live[0].contacts}
    assert len(live[0].approach_paths) == 5
    assert live[1].approach_paths == ()  # a second capture after one closing
    assert live[1].hand_motion_world.x() == pytest.approx(0.01, abs=0.002)
    assert (live[1].motion_sigma is not None) == (fingertips == "nano17")  # a carry that was felt, or only assumed
    frames = [outcome for outcome in outcomes if isinstance(outcome, TruthFrame)]
    assert [frame.grasp_index for frame in frames] == [0, 1]
    assert frames[0].frame.image.ndim == 2
