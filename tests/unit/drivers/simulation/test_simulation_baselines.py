"""The simulated rig in numbers: its bodies, its objects, and what its devices send while the hand does a few things."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gtsam import Pose3

from drivers.camera.boards import GridBoard
from drivers.camera.packet import decode_packet
from drivers.core.fingertip import RigidTransform, TipBody
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.protocol.motor_data import FromMotor, ToMotor
from drivers.shadow.protocol.palm_codec import decode_status
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.model import build_model
from drivers.simulation.objects import CATALOGUE, object_model
from drivers.simulation.settings import BiotacSettings, HandBoard, JointSensorSettings, ObjectStart, SimulationSettings
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.plain_values import plain
from tests.support.simulated_program import Program, records

OF_MODEL = (
    "body_mass", "body_inertia", "body_pos", "body_quat", "body_ipos", "geom_type", "geom_size", "geom_pos",
    "geom_quat", "geom_friction", "geom_solref", "geom_solimp", "geom_contype", "geom_conaffinity", "geom_condim",
    "geom_priority",
    "jnt_type", "jnt_axis", "jnt_range", "jnt_pos", "jnt_stiffness", "dof_armature", "dof_damping", "dof_frictionloss",
    "actuator_gainprm", "actuator_biasprm", "actuator_ctrlrange", "actuator_forcerange", "actuator_gear",
    "tendon_range", "tendon_stiffness", "tendon_damping", "wrap_prm", "eq_data", "eq_solref", "site_pos", "site_quat",
    "sensor_type", "sensor_noise", "exclude_signature", "mesh_pos",
)  # fmt: skip
BOARD = HandBoard(
    board=GridBoard(columns=2, rows=2),
    palm_T_board=RigidTransform(translation_m=(-0.01, -0.012, 0.045), rpy_rad=(float(np.pi / 2), 0.0, 0.0)),
)
SETTINGS = SimulationSettings(
    object="l-block",
    start=ObjectStart(x_m=0.02, y_m=-0.01, yaw_rad=0.4),
    joint_sensors=JointSensorSettings(noise_rad=0.0),
)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_bodies_of_hand_positioner_table_and_object(side: str) -> None:
    calibration, form = SimulatedCalibration.from_package(), HandForm(side)
    tips: dict[str, TipBody] = {finger: calibration.tip_body(finger, "nano17") for finger in form.fingers}
    mount = Pose3.Expmap(np.array([0.1, 0.2, -0.3, 0.1, 0.0, 0.2]))
    model = build_model(object_model("sphere" if side == "left" else "hexagonal-prism"), 0.4, tips, mount, form)
    found: dict[str, Any] = {name: digest(getattr(model, name)) for name in OF_MODEL}
    option = model.opt
    found["options"] = [option.timestep, option.integrator, option.solver, option.cone, option.impratio]
    assert_baseline(f"simulation/model_{side}", found, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("kind", ["nano17", "biotac"])
def test_the_fingertips_of_the_packaged_hand(kind: str) -> None:
    calibration = SimulatedCalibration.from_package()
    assert_baseline(f"simulation/tips_{kind}", {f: plain(calibration.tip_body(f, kind)) for f in ("FF", "TH")})


def test_the_objects_of_the_catalogue() -> None:
    found = {}
    for name in CATALOGUE:
        target = object_model(name)
        solids = [
            plain(piece) if hasattr(piece, "kind") else digest(piece.vertices_object_m) for piece in target.pieces
        ]
        figures = [target.mesh.volume, target.mesh.area, target.height_m, target.rest_height_m]
        foot = digest(target.foot_object_m)
        found[name] = [figures, digest(target.mesh.bounds), foot, plain(target.marker), target.rolls, solids]
    assert_baseline("simulation/objects", found)


def palm_story(program: Program) -> list[Any]:
    """Every kind of motor data while fingers close, then torques, a reset and silence; counts as numbers."""
    told = []
    for step, kind in enumerate(FromMotor):
        duty = np.where(np.arange(20) % 3 == 0, 300 - 40 * step, 90)
        order = ToMotor.DEMAND_PWM if step < 11 else ToMotor.DEMAND_TORQUE
        if step == 12:
            order, duty = ToMotor.RESET, np.where(np.arange(20) == 4, 0x5204, 0)
        asked = {"from_motor_data_type": int(kind), "to_motor_data_type": int(order), "motor_data": duty}
        program.ask(**asked, which_motors=step % 2, tactile_data_type=step)
        program.wait()
        status = decode_status(program.ask(**asked, which_motors=step % 2, tactile_data_type=step).payload)
        told.append([kind.name, *(np.asarray(part, float) for part in (status.torque, status.misc))])
        told[-1] += [digest(status.sensors), digest(status.tactile), status.arrived, status.had_errors]
        told[-1] += [status.tactile_valid, status.tactile_data_type, float(status.idle_time_us)]
    return told


def truth(program: Program) -> dict[str, Any]:
    sample = program.world.truth()
    return {"time": sample.stamp_ns, "object": plain(sample.world_T_object), "table": list(sample.fingers_on_table)} | {
        "contacts": [[each.finger, each.point_world_m, each.normal_world, each.force_N] for each in sample.contacts]
    }


def test_what_a_rig_with_force_fingertips_sends() -> None:
    program = Program(SETTINGS, seed=4)
    program.plant.pose_hand(np.full(24, 0.3))
    forces = {finger: program.start_forces(finger) for finger in ("FF", "TH")}
    told = palm_story(program)
    base = program.move_base(np.array([-0.25, 0.05, 0.30, 0.2, 0.1, -0.1]), cycles=12)
    program.transports["camera"].send(b"TRIGGER")
    program.wait(60_000_000)
    frame = decode_packet(program.transports["camera"].receive()[0])
    arrived = {name: records(transport.receive()) for name, transport in forces.items()}
    assert frame.detection is not None
    assert frame.image is not None
    forces_felt = {name: each["counts"][-3:].astype(float) for name, each in arrived.items()}
    counted = {name: [len(each), *each[-1].tolist()[:3]] for name, each in arrived.items()}
    assert_baseline(
        "simulation/force_rig", {"palm": told, "forces": forces_felt, "counted": counted}, rtol=1e-6, atol=1.5
    )
    moved = {"base": base, "joints": program.joints_rad(), "true": program.plant.joints_rad, "truth": truth(program)}
    assert_baseline("simulation/force_rig_moved", moved, rtol=1e-4, atol=2e-5)
    markers = {str(number): [seen.corners_px, seen.blur_px] for number, seen in frame.detection.markers.items()}
    picture = [float(frame.image.mean()), float(frame.image.std()), *frame.image[::60, ::80].mean(axis=1).astype(float)]
    assert_baseline("simulation/picture", {"markers": markers, "grey": picture, "counter": frame.counter}, atol=0.2)


def test_what_a_rig_with_biotacs_and_a_board_on_its_palm_sends() -> None:
    settings = SETTINGS.model_copy(
        update={"fingertips": "biotac", "biotac": BiotacSettings(), "side": "left", "hand_board": BOARD}
    )
    program = Program(settings, seed=5)
    told = palm_story(program)
    program.transports["camera"].send(b"TRIGGER")
    program.wait(60_000_000)
    seen = decode_packet(program.transports["camera"].receive()[0]).detection
    assert seen is not None
    program.move_base(np.array([-0.30, 0.0, 0.10, 0.0, 0.3, 0.0]), cycles=40)
    status = program.status(tactile_data_type=0x0F)
    found = {"palm": told, "tactile": np.asarray(status.tactile, float)}
    assert_baseline("simulation/biotac_rig", found, rtol=1e-6, atol=1.5)
    assert_baseline("simulation/biotac_rig_moved", truth(program), atol=1e-3)  # after a push: less exact
    markers = {str(number): marker.corners_px for number, marker in seen.markers.items()}
    assert_baseline("simulation/board_on_the_palm", markers, atol=0.2)
