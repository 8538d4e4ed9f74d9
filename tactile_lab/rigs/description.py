"""Rig files: the devices of a rig and the calibration to use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, SerializeAsAny, create_model, model_validator

from calibration.store.admission import Installation
from drivers.core.configuration import StrictModel, load, recorded_keys, validate
from drivers.core.errors import ConfigurationError
from drivers.core.extensions import load_extension
from drivers.core.registry import Registry
from drivers.fingertips.kind import FingertipKind, LinkedKind
from drivers.fingertips.kinds import FINGERTIPS, WIRES
from drivers.positioner.kinds import POSITIONERS, PositionerKind
from drivers.shadow.device.hand_settings import HandSettings
from drivers.simulation.settings import SimulationSettings
from sessions.perception.perception import PerceptionSettings
from sessions.recording.session import Session
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.rigs.wires import Wires
from tactile_lab.slam.tracking.contacts.motion import UNHELD, MotionNoise

OTHER_VERSION = "Use the version of tactile-lab that recorded it; tactile-lab session show names it"
"""Advice for a recorded description that does not fit this version."""


_KINDS: Mapping[str, Registry[Any]] = {"fingertips": FINGERTIPS, "positioner": POSITIONERS}
"""Keys that determine the meaning of other keys."""


class RigMotion(MotionNoise):
    """How far objects slip on a rig, where nobody but the hand moves what stands there; see :class:`MotionNoise`."""

    unheld: float = Field(default=UNHELD, gt=0, le=1)


class CalibrationFiles(StrictModel):
    """Calibration files, relative to the rig file.

    Attributes:
        joints: joint sensor tables of this hand (Shadow's calibration.yaml).
        motors: which motor pulls which joint.
        boards: settings of the motor boards; on wires they are uploaded at every start, and kept when left out.
        rates: how often each type is requested from the motors, in place of ``hand.polling``; for hands on wires.
        gains: position control of this hand (``sr_edc_joint_position_controllers_PWM.yaml``); for hands on wires.
        fingertips: shape, mounting and weight of the fingertips.
        forearm: the positioner's pose in the world.
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
            raise ValueError("camera and markers belong together: give both or neither")
        return self


class RigDescription(StrictModel):
    """A rig; made by :func:`describe`.

    Attributes:
        name, summary: for people.
        kind: where the bytes come from: a simulated world in this program, or devices on wires.
        cycle_s: period of the common cycle, seconds.
        fingertips: the kind of fingertip on all fingers, registered in :mod:`drivers.fingertips.kinds`. Its settings
            stand under its name, in a model that :func:`describe` makes for the file.
        positioner: what carries the hand, registered in :mod:`drivers.positioner.kinds`; its settings are ``base``.
        extensions: Python files, relative to the rig file, that register what the rig names and the program lacks.
        calibration: files to use.
        installation: the installation that the calibrations belong to, so that several rig files of one can share them;
            the rig's own name unless given.
        devices: serial numbers by device name (hand, base, camera, ft/FF ...); a calibration of another is refused,
            and so is another hand on a cable.
        wires: where the devices are, for kind ``wired``.
        emulated: devices on wires are emulated by this program, in real time, over a simulated plant.
        hand, base, perception, conductor: settings of the parts.
        motion: how far a re-oriented object strays from the hand's motion on this rig, one standard deviation.
        simulation: the simulated world (its fingertips follow ``fingertips``), of kind ``simulated`` or emulated.
    """

    renamed: ClassVar = {"station": "installation", "stand_ins": "emulated"}

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    summary: str
    kind: Literal["simulated", "wired"]
    cycle_s: float = Field(ge=0.001, le=0.02)
    fingertips: Annotated[str, AfterValidator(FINGERTIPS.known)]
    positioner: Annotated[str, AfterValidator(POSITIONERS.known)] = "six-axis"
    extensions: tuple[str, ...] = ()
    calibration: CalibrationFiles
    installation: str = ""
    devices: dict[str, str] = Field(default_factory=dict)
    wires: Wires | None = None
    emulated: bool = False
    hand: HandSettings = HandSettings()
    base: SerializeAsAny[StrictModel] = StrictModel()
    perception: PerceptionSettings = PerceptionSettings()
    conductor: SessionSettings = SessionSettings()
    motion: RigMotion = RigMotion()
    simulation: SimulationSettings = SimulationSettings()

    @property
    def fingertip_kind(self) -> FingertipKind[Any]:
        """What the program knows of the rig's kind of fingertip."""
        return FINGERTIPS[self.fingertips]

    @property
    def fingertip_settings(self) -> StrictModel:
        """What the rig file says under the kind's name; the kind's usual settings where it says nothing."""
        own: StrictModel = getattr(self, self.fingertips, None) or self.fingertip_kind.settings()
        return own

    @property
    def positioner_kind(self) -> PositionerKind:
        """What the program knows of the rig's positioner."""
        return POSITIONERS[self.positioner]

    @model_validator(mode="after")
    def _wires_fit(self) -> RigDescription:
        if (self.kind == "wired") != (self.wires is not None):
            raise ValueError("a rig of kind wired needs wires, and no other kind may have them")
        if self.wires is None and any((self.calibration.boards, self.calibration.rates, self.calibration.gains)):
            raise ValueError("calibration.boards, rates and gains are only for a hand on wires")
        if self.emulated and self.kind != "wired":
            raise ValueError("emulated is only for kind wired: a simulated rig needs no emulators")
        if self.wires is not None and bool(self.wires.fingertips) != isinstance(self.fingertip_kind, LinkedKind):
            linked = ", ".join(name for name, kind in FINGERTIPS.items() if isinstance(kind, LinkedKind))
            raise ValueError(f"wires.fingertips is only for fingertips with wires ({linked}): others use the palm's")
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
        return Installation(self.description.installation or self.description.name, self.description.devices)

    @property
    def own_calibrations(self) -> dict[str, Path]:
        """The files that are ours to judge: all but the maker's ``.cal`` files, and extensions."""
        return {role: file for role, file in self.files.items() if file.suffix not in {".cal", ".py"}}

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
        raise ConfigurationError("no such rig", where=name_or_path, hint=f"Use one of {known}, or a .yaml file")
    content = load(path)
    if isinstance(content, dict) and content.get("kind") == "fingertips":
        raise ConfigurationError(
            "has only fingertips, and no hand to run a session with",
            where=str(path),
            hint="Use it with tactile-lab rig check",
        )
    extensions = _extensions(content, path)
    for extension in extensions.values():
        load_extension(extension)
    description = describe(content, where=str(path))
    named = description.calibration.model_dump(exclude_none=True)
    files = {role: path.parent / file for role, file in (named | wire_files(description)).items()}
    return Rig(description, _present(files | extensions, str(path)), str(path))


def describe(content: Any, *, where: str, hint: str = "Correct the file and try again") -> RigDescription:
    """A rig's description from plain data.

    The model is made for the data: the settings of the fingertips stand under their kind's name, and are, like those of
    the positioner and its wire, what the registered kind says they are.

    Raises:
        ConfigurationError: it does not fit; names each key.
    """
    given = content if isinstance(content, dict) else {}
    for key, registry in _KINDS.items():
        if isinstance(name := given.get(key), str) and name not in registry:  # other complaints would follow from it
            raise ConfigurationError(f"{key}: {registry.unknown(name)}. {registry.listed()}", where=where, hint=hint)
    fields: dict[str, Any] = {
        name: (FINGERTIPS[name].settings, FINGERTIPS[name].settings())
        for name in FINGERTIPS
        if name in (given.get("fingertips"), *given)
    }
    if clash := sorted(set(fields) & set(RigDescription.model_fields)):
        what, hint = f"the fingertip kind {clash[0]!r} has the name of another key of rig files", "Choose another name"
        raise ConfigurationError(what, where=FINGERTIPS.file(clash[0]), hint=hint)
    if (named := given.get("positioner", RigDescription.model_fields["positioner"].default)) in POSITIONERS:
        kind = POSITIONERS[named]
        fields["base"] = (kind.settings, kind.settings())
        fields["wires"] = (create_model("Wires", __base__=Wires, base=(kind.wiring, ...)) | None, None)
    return validate(content, create_model("RigDescription", __base__=RigDescription, **fields), where=where, hint=hint)


def _extensions(content: Any, path: Path) -> dict[str, Path]:
    """The extensions that a rig file names, by the role of the session's copies. Raises ConfigurationError."""
    named = content.get("extensions") or () if isinstance(content, dict) else ()
    if not isinstance(named, list | tuple) or not all(isinstance(file, str) for file in named):
        raise ConfigurationError("extensions: must be a list of files", where=str(path))
    return {f"extension-{Path(file).stem}": path.parent / file for file in named}


def wire_files(description: RigDescription) -> dict[str, str]:
    """The files that the fingertips' wires name, such as ``.cal`` files, by role."""
    wires = description.wires.fingertips if description.wires else {}
    return {
        wire_role(finger, setting): file
        for finger, wire in wires.items()
        for setting, file in WIRES[wire.wire].files(wire).items()
    }


def wire_role(finger: str, setting: str) -> str:
    """Under which role the file is kept that a setting of a finger's wire names."""
    return f"gauges-{finger}" if setting == "calibration" else f"{setting}-{finger}"


def rig_of_session(session: Session) -> Rig:
    """The rig a session was recorded with, on its own copies of the calibration files.

    Raises:
        ConfigurationError: the recorded description does not fit this version.
        SessionError: a calibration copy is missing or was changed.
    """
    where = f"{session.folder}/session.yaml"
    kept = [session.calibration_file(role) for role in session.manifest.calibration if role.startswith("extension-")]
    named = " ".join(f"--extension {file}" for file in kept)
    hint = (
        f"The session ran with its own extension code. Check that code, then use tactile-lab {named}"
        if kept
        else OTHER_VERSION
    )
    with recorded_keys():
        description = describe(session.manifest.rig_description, where=where, hint=hint)
    files = {role: session.calibration_file(role) for role in session.manifest.calibration}
    return Rig(description, files, where)


def shipped_rigs() -> dict[str, Path]:
    """Rig files that come with the program, by name."""
    return {path.stem: path for path in sorted(_shipped_files(), key=lambda path: path.stem)}


def _shipped_files() -> Iterator[Path]:
    folder = Path(str(resources.files("tactile_lab.rigs")))
    yield from folder.glob("*.yaml")


def _present(files: dict[str, Path], where: str) -> dict[str, Path]:
    for role, file in files.items():
        if not file.is_file():
            hint = f"Calibrate it, or correct calibration.{role} in the rig file"
            raise ConfigurationError(f"names a missing {role} calibration: {file}", where=where, hint=hint)
    return files
