"""From a rig's description to connected devices, and to the decoders a replay needs."""

from __future__ import annotations

from calibration.forearm import load_forearm
from drivers.ati.nano17 import Nano17
from drivers.biotac.biotac import BioTac, BioTacCalibration, EllipsoidSkinSettings, load_biotacs
from drivers.biotac.learned_normal import load_normals
from drivers.camera.calibration import load_camera
from drivers.camera.camera import Camera
from drivers.camera.markers import MarkerSettings
from drivers.fingertip import FingertipCalibration, load_fingertips
from drivers.links import Link, ReplayLink, TappedLink
from drivers.positioner import Positioner, mount_T_forearm
from drivers.shadow.hand import ShadowHand
from drivers.shadow.hand_samples import HandDecoder
from drivers.shadow.joint_calibration import JointCalibration
from drivers.shadow.motors import MotorMap
from drivers.shadow.palm_images import PALMS
from drivers.shadow.posture import TipEllipsoid
from drivers.simulation.world import SimulatedWorld
from sessions.bench import Bench
from sessions.closing_lines import TipSurface
from sessions.interpreter import BASE_LINK, CAMERA_LINK, HAND_LINK, Interpreter, Observer, fingertip_link
from sessions.perception import Perception
from sessions.recorder import Recorder
from sessions.sensor_stream import SensorStream
from tactile_lab.clock import NANOSECONDS, Clock, VirtualClock
from tactile_lab.errors import ConfigurationError
from tactile_lab.geometry.contacts import FINGERS
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.wired import camera_source, force_wire, hand_setup
from tactile_lab.rigs.wires import LocalCamera
from tactile_lab.strict_yaml import load_model


def check_calibration(rig: Rig) -> None:
    """Read every calibration file of a rig, so that a broken one shows before anything moves or is recorded.

    Raises:
        ConfigurationError: a file that does not fit; names it.
    """
    build_interpreter(rig)
    MotorMap.load(rig.files["motors"])
    if rig.description.wires is not None:
        hand_setup(rig).check_files()
    if "camera" in rig.files:
        load_camera(rig.files["camera"])
        load_model(rig.files["markers"], MarkerSettings)
        if rig.description.wires is not None and isinstance(camera := rig.description.wires.camera, LocalCamera):
            camera_source(rig, camera)


def simulated_world(rig: Rig, seed: int, object_name: str) -> SimulatedWorld:
    """The world of a simulated rig with an object on its table.

    Raises:
        ConfigurationError: no such object.
        ShapeError: the object's mesh can not be used.
    """
    description = rig.description
    changes = {"object": object_name, "fingertips": description.fingertips}
    return SimulatedWorld(description.simulation.model_copy(update=changes), seed)


def build_bench(rig: Rig, world: SimulatedWorld, recorder: Recorder) -> Bench:
    """All devices of a rig on tapped links, not yet connected."""
    links, description = world.links(), rig.description
    observer = Observer(recorder, build_interpreter(rig))

    def tapped(name: str) -> Link:
        return TappedLink(links[name], observer, world.clock)

    def stream(finger: str, calibration: FingertipCalibration) -> SensorStream:
        link = tapped(fingertip_link(finger))
        return SensorStream(Nano17(finger, link, world.clock, calibration, description.nano17), link)

    return Bench(
        clock=world.clock,
        cycle_ns=round(description.cycle_s * NANOSECONDS),
        hand=_hand(rig, tapped(HAND_LINK), world.clock),
        base=Positioner(tapped(BASE_LINK), world.clock, description.base),
        observer=observer,
        wrench_devices={finger: stream(finger, calibration) for finger, calibration in force_tips(rig).items()},
        camera=Camera(tapped(CAMERA_LINK), world.clock) if "camera" in rig.files else None,
        fingertip_calibrations=force_tips(rig),
        truth=world.truth,
        force_ranges_N=force_ranges_N(rig),
    )


def build_interpreter(rig: Rig) -> Interpreter:
    """Decoders and a fresh perception: what understands a rig's bytes, live and in replay alike."""
    clock, description = VirtualClock(), rig.description
    tips = {finger: _decoder(rig, finger, tip, clock) for finger, tip in force_tips(rig).items()}
    forearm = load_forearm(rig.files["forearm"])
    perception = Perception(
        wrench_fingertips=tips,
        slot_fingertips=_biotacs(rig),
        mount_T_forearm=mount_T_forearm,
        world_T_mount=forearm.world_T_mount.pose(),
        mount_covariance=forearm.covariance(),
        tip_surfaces=_tip_surfaces(rig),
        settings=description.perception,
    )
    return Interpreter(
        perception,
        hand=HandDecoder(JointCalibration.load(rig.files["joints"]), PALMS[description.hand.palm]),
        base=Positioner(_silent(BASE_LINK), clock, description.base),
        wrenches=tips,
        camera=Camera(_silent(CAMERA_LINK), clock) if "camera" in rig.files else None,
        clock=clock,
    )


def _hand(rig: Rig, link: Link, clock: Clock) -> ShadowHand:
    tactile = "biotac" if rig.description.fingertips == "biotac" else "none"
    settings = rig.description.hand.model_copy(update={"cycle_s": rig.description.cycle_s, "tactile": tactile})
    joints, motors = JointCalibration.load(rig.files["joints"]), MotorMap.load(rig.files["motors"])
    return ShadowHand(link, clock, joints, settings, motors)


def force_tips(rig: Rig) -> dict[str, FingertipCalibration]:
    """Calibrations of the force fingertips that a rig has, by finger; of those with a wire where it has wires.

    Raises:
        ConfigurationError: a finger with a wire but without a calibration.
    """
    if rig.description.fingertips != "nano17":
        return {}
    calibrations = load_fingertips(rig.files["fingertips"])
    fitted = calibrations if rig.description.wires is None else rig.description.wires.fingertips
    if missing := sorted(set(fitted) - set(calibrations)):
        what = f"the fingertip calibration does not name {', '.join(missing)}"
        raise ConfigurationError(
            what, where=rig.source, hint="Calibrate the finger, or take it out of wires.fingertips"
        )
    return {finger: calibrations[finger] for finger in FINGERS if finger in fitted}


def force_ranges_N(rig: Rig) -> dict[str, float]:
    """Calibrated range of the force fingertips, smallest axis; sensors that tell a smaller one do not connect."""
    return dict.fromkeys(force_tips(rig), min(rig.description.nano17.force_range_N))


def _decoder(rig: Rig, finger: str, calibration: FingertipCalibration, clock: Clock) -> Nano17:
    """What understands a finger's bytes."""
    wire = None if rig.description.wires is None else force_wire(rig, finger)
    return Nano17(finger, _silent(fingertip_link(finger)), clock, calibration, rig.description.nano17, wire)


def _biotacs(rig: Rig) -> dict[str, BioTac]:
    if rig.description.fingertips != "biotac":
        return {}
    calibrations = load_biotacs(rig.files["fingertips"])
    normals = load_normals(rig.files["normals"]) if "normals" in rig.files else {}
    fitted = [finger for finger in FINGERS if finger in calibrations]
    return {finger: BioTac(finger, calibrations[finger], normals=normals.get(finger)) for finger in fitted}


def _tip_surfaces(rig: Rig) -> dict[str, TipSurface]:
    """What each finger touches with; the usual tip where a BioTac's calibration names no ellipsoid."""
    if rig.description.fingertips == "nano17":
        tips = force_tips(rig)
        return {finger: TipSurface.upright(tip.semi_axes_m, tip.centre_distal_m) for finger, tip in tips.items()}
    return {finger: _skin(tip) for finger, tip in load_biotacs(rig.files["fingertips"]).items()}


def _skin(biotac: BioTacCalibration) -> TipSurface:
    if not isinstance(biotac.skin, EllipsoidSkinSettings):
        usual = TipEllipsoid()
        return TipSurface.upright(usual.semi_axes_m, usual.centre_distal_m)
    centre = TipSurface.upright(biotac.skin.semi_axes_m, biotac.skin.centre_m)
    return TipSurface(centre.semi_axes_m, biotac.distal_T_sensor.pose() * centre.distal_T_tip)


def _silent(name: str) -> Link:
    """A link for devices that only decode."""
    return ReplayLink(name, ())
