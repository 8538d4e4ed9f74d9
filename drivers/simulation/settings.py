"""Settings of the simulated rig: the object, the fingertips, and the errors of the devices."""

from __future__ import annotations

import math

from pydantic import Field

from drivers.camera.boards import GridBoard
from drivers.camera.rendering.settings import CameraSettings
from drivers.core.configuration import StrictModel
from drivers.core.fingertip import RigidTransform
from drivers.shadow.protocol.palm_images import Side


class ObjectStart(StrictModel):
    """Initial pose of the object: position on the table in the world frame, rotation about the vertical."""

    x_m: float
    y_m: float
    yaw_rad: float


class JointSensorSettings(StrictModel):
    """Errors of the hand's joint sensors, one standard deviation.

    Attributes:
        bias_rad: constant during a session, drawn for each joint of the fingers.
        wrist_bias_rad: the same for the wrist. Zero by default: the forearm-to-world calibration is made with the wrist
            held fixed, and absorbs its bias.
        noise_rad: from reading to reading.
    """

    bias_rad: float = Field(default=math.radians(0.6), ge=0.0)
    wrist_bias_rad: float = Field(default=0.0, ge=0.0)
    noise_rad: float = Field(default=math.radians(0.1), ge=0.0)


class ForceSensorSettings(StrictModel):
    """A Nano17 SI-12-0.12 behind a Net F/T box (protocols: Net F/T; Nano17 ratings).

    Attributes:
        rate_hz: records per second (the box's comrdtrate).
        counts_per_N, counts_per_Nm: the box's scale (cfgcpf, cfgcpt).
        offset_N, offset_Nm: untared reading of a session, one standard deviation per axis.
        drift_N, drift_Nm: drift about it, one standard deviation per axis.
        drift_time_s: correlation time of the drift.
        noise_lsb: noise of one reading in steps of the sensor's resolution.
    """

    rate_hz: int = Field(default=100, ge=1, le=500)
    counts_per_N: float = Field(default=1_000_000.0, gt=0.0)
    counts_per_Nm: float = Field(default=1_000_000.0, gt=0.0)
    offset_N: float = Field(default=0.3, ge=0.0)
    offset_Nm: float = Field(default=0.002, ge=0.0)
    drift_N: float = Field(default=0.01, ge=0.0)
    drift_Nm: float = Field(default=5e-5, ge=0.0)
    drift_time_s: float = Field(default=20.0, gt=0.0)
    noise_lsb: float = Field(default=1.0, ge=0.0)


class BiotacSettings(StrictModel):
    """Synthetic BioTac response.

    Attributes:
        noise_counts: noise of an electrode reading.
        response_length_m: distance from a contact within which an electrode responds.
    """

    noise_counts: float = Field(default=4.0, ge=0.0)
    response_length_m: float = Field(default=0.003, gt=0.0)


class HandBoard(StrictModel):
    """A board that the simulated hand carries for calibration: its markers, and its pose on the palm."""

    board: GridBoard
    palm_T_board: RigidTransform


class SimulationSettings(StrictModel):
    """The simulated rig.

    Attributes:
        object: name in the catalogue (:mod:`drivers.simulation.objects`) or ``mesh:<path>``.
        object_mass_kg: its mass.
        start: its initial pose; drawn from the seed if not given.
        start_sigma_m: standard deviation of the drawn position per axis, about the middle of the table. The rotation is
            uniform.
        fingertips: the kind on all five fingers.
        positioner: the kind that carries the hand.
        side: of the hand.
        hand_board: the board that the hand carries for the camera; None for no board.
        world_T_mount: true pose of the positioner; a rig's forearm-to-world calibration may differ from it.
    """

    object: str = "box-10x6x4"
    object_mass_kg: float = Field(default=0.3, gt=0.0, le=5.0)
    start: ObjectStart | None = None
    start_sigma_m: float = Field(default=0.01, ge=0.0, le=0.1)
    fingertips: str = "nano17"
    positioner: str = "six-axis"
    side: Side = "right"
    hand_board: HandBoard | None = None
    world_T_mount: RigidTransform = RigidTransform(translation_m=(0.0, 0.0, 0.0))
    joint_sensors: JointSensorSettings = JointSensorSettings()
    force_sensors: ForceSensorSettings = ForceSensorSettings()
    biotac: BiotacSettings = BiotacSettings()
    camera: CameraSettings = CameraSettings()
