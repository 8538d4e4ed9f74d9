"""Builds a rig's devices from its description, and the decoders for a replay."""

from __future__ import annotations

from typing import Any

import numpy as np

from calibration.forearm.placement import load_forearm
from drivers.camera.calibration import load_camera
from drivers.camera.camera import Camera
from drivers.camera.markers import MarkerSettings
from drivers.core.clock import NANOSECONDS, Clock, VirtualClock
from drivers.core.configuration import load_model
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import FingertipCalibration
from drivers.core.transports import ReplayTransport, TappedTransport, Transport
from drivers.fingertips.kind import FingertipKind, LinkedFingertip, LinkedKind, PalmKind
from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandDecoder
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_images import PALMS
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.world import SimulatedWorld
from sessions.perception.approach_paths import TipSurface
from sessions.perception.interpreter import BASE_LINK, CAMERA_LINK, HAND_LINK, Interpreter, Observer, fingertip_link
from sessions.perception.perception import Perception
from sessions.recording.recorder import Recorder
from sessions.rig_runtime.rig_runtime import RigRuntime
from sessions.rig_runtime.sensor_stream import SensorStream
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.wired import camera_source, force_wire, hand_form, hand_setup, simulation_settings, tactile_of
from tactile_lab.rigs.wires import LocalCamera

_LEAST_FINGERS = 3


def check_calibration(rig: Rig) -> None:
    """Read every calibration file of a rig, so that an invalid one is found before anything moves or is recorded.

    Raises:
        ConfigurationError: an invalid file, with its name.
    """
    _check_fingers(rig)
    _check_driven(rig)
    build_interpreter(rig)
    if rig.description.wires is not None:
        hand_setup(rig).check_files()
    if "camera" in rig.files:
        load_camera(rig.files["camera"])
        load_model(rig.files["markers"], MarkerSettings)
        if rig.description.wires is not None and isinstance(camera := rig.description.wires.camera, LocalCamera):
            camera_source(rig, camera)


def _check_fingers(rig: Rig) -> None:
    """Raises ConfigurationError where the hand has too few fingers for a grasp, or lacks one that has a wire."""
    form, wires = hand_form(rig), rig.description.wires
    if len(form.fingers) < _LEAST_FINGERS:
        what = f"is of a hand with {' and '.join(form.fingers)} only: a grasp needs three fingers"
        hint = "A rig of kind hand can check it, joint by joint"
        raise ConfigurationError(what, where=str(rig.files["motors"]), hint=hint)
    wired = () if wires is None else wires.fingertips
    if strange := [finger for finger in wired if finger not in form.fingers]:
        what = f"names {', '.join(strange)}, but the hand has {', '.join(form.fingers)}"
        raise ConfigurationError(
            what, where=f"{rig.source}: wires.fingertips", hint="Remove what the hand does not have"
        )


def _check_driven(rig: Rig) -> None:
    """Raises ConfigurationError where gains never drive a joint: a straight finger meets everything first."""
    gains = rig.description.hand.gains if rig.description.wires is None else hand_setup(rig).settings().gains
    if idle := [name for name in hand_form(rig).driven if not gains.of(name).is_driven]:
        what = f"never drives {', '.join(idle)}, whose largest demand is 0: a grasp needs every joint"
        where = str(rig.files["gains"]) if "gains" in rig.files else f"{rig.source}: hand.gains"
        raise ConfigurationError(what, where=where, hint="A rig of kind hand can check and drive the others")


def simulated_world(rig: Rig, seed: int, object_name: str) -> SimulatedWorld:
    """The world of a simulated rig with an object on its table.

    Raises:
        ConfigurationError: no such object, a mesh that cannot be used, or no calibration of the fingertips for it.
    """
    settings = simulation_settings(rig, object_name)
    files = rig.files
    calibration = SimulatedCalibration.of_hand(settings.fingertips, files["fingertips"], files["motors"])
    return SimulatedWorld(settings, seed, calibration)


def build_runtime(rig: Rig, world: SimulatedWorld, recorder: Recorder) -> RigRuntime:
    """All devices of a rig on tapped transports, not yet connected."""
    transports, description = world.transports(), rig.description
    observer = Observer(recorder, build_interpreter(rig))

    def tapped(name: str) -> Transport:
        return TappedTransport(transports[name], observer, world.clock)

    def stream(kind: LinkedKind[Any], finger: str, calibration: Any) -> SensorStream:
        transport = tapped(fingertip_link(finger))
        settings = description.fingertip_settings
        return SensorStream(kind.device(finger, calibration, settings, transport, world.clock, None), transport)

    kind, tips = description.fingertip_kind, fitted_tips(rig)
    return RigRuntime(
        clock=world.clock,
        cycle_ns=round(description.cycle_s * NANOSECONDS),
        hand=_hand(rig, tapped(HAND_LINK), world.clock),
        base=description.positioner_kind.device(tapped(BASE_LINK), world.clock, description.base),
        observer=observer,
        wrench_devices={f: stream(kind, f, tip) for f, tip in tips.items()} if isinstance(kind, LinkedKind) else {},
        camera=Camera(tapped(CAMERA_LINK), world.clock) if "camera" in rig.files else None,
        fingertip_calibrations=force_tips(rig),
        truth=world.truth,
        force_ranges_N=force_ranges_N(rig),
    )


def build_interpreter(rig: Rig) -> Interpreter:
    """Decoders and a new Perception for a rig's bytes, live and in a replay."""
    clock, description = VirtualClock(), rig.description
    kind, tips = description.fingertip_kind, fitted_tips(rig)
    linked = {f: _decoder(rig, kind, f, tip, clock) for f, tip in tips.items()} if isinstance(kind, LinkedKind) else {}
    settings = description.fingertip_settings
    slots = {f: kind.sensor(f, tip, settings) for f, tip in tips.items()} if isinstance(kind, PalmKind) else {}
    forearm, form = load_forearm(rig.files["forearm"]), hand_form(rig)
    perception = Perception(
        wrench_fingertips=linked,
        slot_fingertips=slots,
        mount_T_forearm=mount_T_forearm,
        world_T_mount=forearm.world_T_mount.pose(),
        mount_covariance=forearm.covariance(),
        tip_surfaces={finger: _tip_surface(kind, tip) for finger, tip in tips.items()},
        settings=description.perception,
        form=form,
        motors=MotorMap.load(rig.files["motors"]),
        stays=description.motion.unheld < 1,
    )
    return Interpreter(
        perception,
        hand=HandDecoder(JointCalibration.load(rig.files["joints"], form.joints), PALMS[description.hand.palm]),
        base=description.positioner_kind.device(_silent(BASE_LINK), clock, description.base),
        wrenches=linked,
        camera=Camera(_silent(CAMERA_LINK), clock) if "camera" in rig.files else None,
        clock=clock,
    )


def _hand(rig: Rig, transport: Transport, clock: Clock) -> ShadowHand:
    description = rig.description
    settings = description.hand.model_copy(update={"cycle_s": description.cycle_s, "tactile": tactile_of(rig)})
    motors = MotorMap.load(rig.files["motors"])
    joints = JointCalibration.load(rig.files["joints"], hand_form(rig).joints)
    return ShadowHand(transport, clock, joints, settings, motors)


def fitted_tips(rig: Rig) -> dict[str, Any]:
    """Calibration of each fingertip of a rig, by finger; with wires, only of the wired ones.

    Raises:
        ConfigurationError: a finger with a wire but without a calibration, or an invalid file.
    """
    kind, wires = rig.description.fingertip_kind, rig.description.wires
    known = kind.load(rig.files)
    fitted = wires.fingertips if wires is not None and isinstance(kind, LinkedKind) else known
    if missing := sorted(set(fitted) - set(known)):
        what = f"the fingertip calibration does not name {', '.join(missing)}"
        raise ConfigurationError(
            what, where=rig.source, hint="Calibrate the finger, or remove it from wires.fingertips"
        )
    return {finger: known[finger] for finger in hand_form(rig).fingers if finger in fitted}


def force_tips(rig: Rig) -> dict[str, FingertipCalibration]:
    """As :func:`fitted_tips`, those with a force sensor."""
    return {f: tip for f, tip in fitted_tips(rig).items() if isinstance(tip, FingertipCalibration)}


def force_ranges_N(rig: Rig) -> dict[str, float]:
    """Calibrated range of the force fingertips, smallest axis; sensors that report a smaller one do not connect."""
    range_N = rig.description.fingertip_kind.force_range_N(rig.description.fingertip_settings)
    return {} if range_N is None else dict.fromkeys(fitted_tips(rig), range_N)


def _decoder(rig: Rig, kind: LinkedKind[Any], finger: str, calibration: Any, clock: Clock) -> LinkedFingertip:
    """The decoder of a finger's bytes."""
    wire = None if rig.description.wires is None else force_wire(rig, finger)
    transport = _silent(fingertip_link(finger))
    return kind.device(finger, calibration, rig.description.fingertip_settings, transport, clock, wire)


def _tip_surface(kind: FingertipKind[Any], calibration: Any) -> TipSurface:
    """The touching surface of a finger; the default tip if its calibration has no ellipsoid."""
    if (surface := kind.surface(calibration)) is None:
        usual = TipEllipsoid()
        return TipSurface.upright(usual.semi_axes_m, usual.centre_distal_m)
    semi_axes_m, distal_T_tip = surface
    return TipSurface(np.array(semi_axes_m), distal_T_tip)


def _silent(name: str) -> Transport:
    """A transport for devices that only decode."""
    return ReplayTransport(name, ())
