"""What a rig file says. One program, many rigs: the file names the devices and the calibration to use."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from calibration.admission import Installation
from drivers.ati.nano17 import Nano17Settings
from drivers.ati.wiring import VoltsWiring
from drivers.positioner import PositionerSettings
from drivers.shadow.hand_settings import HandSettings
from drivers.simulation.settings import SimulationSettings
from sessions.conductor_settings import ConductorSettings
from sessions.perception import PerceptionSettings
from sessions.session import Session
from tactile_lab.errors import ConfigurationError
from tactile_lab.rigs.wires import Wires
from tactile_lab.strict_yaml import StrictModel, load, validate
from tactile_lab.tracking.motion import MotionNoise

OTHER_VERSION = "Use the version of tactile-lab that recorded it; tactile-lab session show names it"
"""Advice for a recorded description that does not fit this version."""


class CalibrationFiles(StrictModel):
    """Calibration files, relative to the rig file.

    Attributes:
        joints: joint sensor tables of this hand (Shadow's calibration.yaml).
        motors: which motor pulls which joint.
        boards: settings of the motor boards; on wires they are uploaded at every start, and kept when left out.
        rates: how often motors are asked for what, in place of ``hand.polling``; for hands on wires.
        gains: position control of this hand (``sr_edc_joint_position_controllers_PWM.yaml``); for hands on wires.
        fingertips: shape, mounting and weight of the fingertips.
        forearm: where the positioner stands in the world.
        normals: learned contact normals of BioTacs; the skin's at equation 2.24's point without.
        camera, markers: lens, and the markers of the rig; left out for a rig without a camera.
        geometry: what fingertips press to calibrate: edges of the table, a block, marked points.
        block: a block at a known place, for the joints' calibration.
        board: what the hand shows to the camera to calibrate.
    """

    joints: str
    motors: str
    boards: str | None = None
    rates: str | None = None
    gains: str | None = None
    fingertips: str
    forearm: str
    normals: str | None = None
    camera: str | None = None
    markers: str | None = None
    geometry: str | None = None
    block: str | None = None
    board: str | None = None

    @model_validator(mode="after")
    def _camera_with_markers(self) -> CalibrationFiles:
        if (self.camera is None) != (self.markers is None):
            raise ValueError("camera and markers belong together: name both or neither")
        return self


class RigDescription(StrictModel):
    """A rig.

    Attributes:
        name, summary: for people.
        kind: where the bytes come from: a simulated world in this program, or devices on wires.
        cycle_s: period of the common cycle, seconds.
        fingertips: the kind of fingertip on all fingers.
        calibration: files to use.
        station: the installation that the calibrations belong to, so that several rig files of one can share them;
            the rig's own name unless given.
        devices: serial numbers by device name (hand, base, camera, ft/FF ...); a calibration of another is refused.
        wires: where the devices are, for kind ``wired``.
        stand_ins: devices on wires are emulated by this program, in real time, over a simulated plant.
        hand, nano17, base, perception, conductor: settings of the parts.
        motion: how far a re-oriented object strays from the hand's motion on this rig, one standard deviation.
        simulation: the simulated world (its fingertips follow ``fingertips``), of kind ``simulated`` or stand-ins.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    summary: str
    kind: Literal["simulated", "wired"]
    cycle_s: float = Field(ge=0.001, le=0.02)
    fingertips: Literal["nano17", "biotac"]
    calibration: CalibrationFiles
    station: str = ""
    devices: dict[str, str] = Field(default_factory=dict)
    wires: Wires | None = None
    stand_ins: bool = False
    hand: HandSettings = HandSettings()
    nano17: Nano17Settings = Nano17Settings()
    base: PositionerSettings = PositionerSettings()
    perception: PerceptionSettings = PerceptionSettings()
    conductor: ConductorSettings = ConductorSettings()
    motion: MotionNoise = MotionNoise()
    simulation: SimulationSettings = SimulationSettings()

    @model_validator(mode="after")
    def _wires_fit(self) -> RigDescription:
        if (self.kind == "wired") != (self.wires is not None):
            raise ValueError("wires belong to kind wired, and kind wired needs them")
        if self.wires is None and any((self.calibration.boards, self.calibration.rates, self.calibration.gains)):
            raise ValueError("calibration.boards, rates and gains belong to a hand on wires")
        if self.stand_ins and self.kind != "wired":
            raise ValueError("stand_ins belong to kind wired: a simulated rig needs none")
        if self.wires is not None and bool(self.wires.fingertips) != (self.fingertips == "nano17"):
            raise ValueError("wires.fingertips belong to nano17 fingertips; BioTacs send through the palm")
        if self.wires is not None and self.wires.camera is not None and self.calibration.camera is None:
            raise ValueError("wires.camera needs calibration.camera and calibration.markers")
        return self


@dataclass(frozen=True)
class Rig:
    """A description with the calibration files it names, by role, all of them present."""

    description: RigDescription
    files: dict[str, Path]
    source: str

    @property
    def installation(self) -> Installation:
        """What a calibration has to belong to."""
        return Installation(self.description.station or self.description.name, self.description.devices)

    @property
    def own_calibrations(self) -> dict[str, Path]:
        """The files that are ours to judge: all but the maker's ``.cal`` files."""
        return {role: file for role, file in self.files.items() if file.suffix != ".cal"}

    def plain(self) -> dict[str, Any]:
        """The description as plain data, the form kept in ``session.yaml``."""
        return self.description.model_dump(mode="json")


def load_rig(name_or_path: str) -> Rig:
    """A shipped rig by its name, or a rig file by its path.

    Raises:
        ConfigurationError: no such rig, a file that does not fit, or a calibration file that is missing.
    """
    path = Path(name_or_path)
    if path.suffix not in {".yaml", ".yml"}:
        path = shipped_rigs().get(name_or_path, path)
    if path.suffix not in {".yaml", ".yml"}:
        known = ", ".join(shipped_rigs())
        raise ConfigurationError("no such rig", where=name_or_path, hint=f"Name one of {known}, or a .yaml file")
    content = load(path)
    if isinstance(content, dict) and content.get("kind") == "fingertips":
        raise ConfigurationError(
            "has fingertips alone, and no hand to run a session with", where=str(path), hint="Use it with rig check"
        )
    description = validate(content, RigDescription, where=str(path))
    named = description.calibration.model_dump(exclude_none=True)
    files = {role: path.parent / file for role, file in (named | gauge_files(description)).items()}
    return Rig(description, _present(files, str(path)), str(path))


def gauge_files(description: RigDescription) -> dict[str, str]:
    """The ``.cal`` files that the wires of force fingertips name, by role."""
    wires = description.wires.fingertips if description.wires else {}
    return {gauge_role(finger): wire.calibration for finger, wire in wires.items() if isinstance(wire, VoltsWiring)}


def gauge_role(finger: str) -> str:
    """Under which role a finger's ``.cal`` file is kept."""
    return f"gauges-{finger}"


def rig_of_session(session: Session) -> Rig:
    """The rig a session was recorded with, on its own copies of the calibration files.

    Raises:
        ConfigurationError: the recorded description does not fit this version.
        SessionError: a calibration copy is missing or was changed.
    """
    where = f"{session.folder}/session.yaml"
    description = validate(session.manifest.rig_description, RigDescription, where=where, hint=OTHER_VERSION)
    files = {role: session.calibration_file(role) for role in session.manifest.calibration}
    return Rig(description, files, where)


def shipped_rigs() -> dict[str, Path]:
    """Rig files that come with the program, by name."""
    return {path.stem: path for path in sorted(_shipped(), key=lambda path: path.stem)}


def _shipped() -> Iterator[Path]:
    folder = Path(str(resources.files("tactile_lab.rigs")))
    yield from folder.glob("*.yaml")


def _present(files: dict[str, Path], where: str) -> dict[str, Path]:
    for role, file in files.items():
        if not file.is_file():
            hint = f"Calibrate it, or correct calibration.{role} in the rig file"
            raise ConfigurationError(f"names a {role} calibration that is missing: {file}", where=where, hint=hint)
    return files
