"""Configuration folders of hands as Shadow publishes them, on the emulated ring, as a table.

python -m tests.support.published_hands_table FOLDER ... --maps FOLDER --store

The folders are not part of this repository: a user names them, and the folder of motor maps beside them. Only serial
numbers and outcomes are stored. All hands of a checkout of Shadow's repository are one folder above theirs.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from drivers.core import configuration
from drivers.core.errors import ConfigurationError, TactileLabError
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.ethercat.hand_transport import EthercatSettings
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.hand_info import INFO_FILE, HandInfo, stated_serial
from tests.support.emulated_hands import EmulatedBench
from tests.support.stored_table import GrowingTable, Outline, parser

_CALIBRATION = "calibration.yaml"
_COMMAND = "python -m tests.support.published_hands_table FOLDER ... --maps FOLDER --store"
OUTLINE = Outline(
    "published-hands",
    "Folders of real hands as Shadow publishes them: loaded and moved motor by motor, or refused with the reason.",
    (_COMMAND,),
    "Every hand's folder below those that were named, with the motor map that its `general_info.yaml` names. It is "
    "checked as by `rig check --move`, on the emulated ring in one process and virtual time, with the calibration, "
    "gains, rates and settings of the boards that it contains. The folders are not part of this repository.",
    ("Kind", "Motor map", "Outcome", "Hands", "Serial numbers"),
    keys=3,
)


def published_folders(roots: Iterable[Path]) -> list[Path]:
    """Folders of hands below these, by serial number. A template inside a hand's folder is no hand."""
    known = {place.parent for root in roots for place in root.rglob(INFO_FILE)}
    known |= {place.parent.parent for root in roots for place in root.rglob(f"calibrations/{_CALIBRATION}")}
    hands = [folder for folder in known if known.isdisjoint(folder.parents)]
    return sorted(hands, key=lambda folder: (len(folder.name), folder.name))


def map_name(folder: Path) -> str:
    """The file of the motor map that a folder names. Raises ConfigurationError."""
    info = _info(folder)
    if info.mapping_path is None:
        raise ConfigurationError("names no motor map", where=str(folder / INFO_FILE), hint="Give mapping_path")
    return info.mapping_path.relative_path.name


def published_setup(folder: Path, maps: Path) -> HandSetup:
    """A hand by its published folder. Raises ConfigurationError."""
    joints = _file(folder, _CALIBRATION)
    if joints is None:
        raise ConfigurationError(f"has no {_CALIBRATION}", where=str(folder), hint="Ask Shadow for the hand's folder")
    return HandSetup(
        ethercat=EthercatSettings(interface="memory"),
        hand=HandSettings(cycle_s=0.002),
        joints=joints,
        motors=maps / map_name(folder),
        boards=_file(folder, "motor_board_effort_controllers.yaml"),
        rates=_file(folder, "motor_data_polling.yaml"),
        gains=_file(folder, "sr_edc_joint_position_controllers_PWM.yaml"),
    )


def outcome(folder: Path, maps: Path) -> str:
    """``moved``, or why not."""
    try:
        setup = published_setup(folder, maps)
        bench = EmulatedBench(setup, stated_serial(setup.infos()) or 634)
        findings = bench.moves()
    except TactileLabError as error:
        return str(error)
    left_out = [joint for joint in bench.motors.driven if joint not in bench.hand.drivable]
    moved = f"moved; not to be driven: {', '.join(left_out)}" if left_out else "moved"
    return "; ".join(str(finding) for finding in findings if not finding.ok) or moved


def kind(folder: Path, maps: Path) -> tuple[str, str]:
    """Side and number of fingers in words, and the motor map; what the folder does not tell is left out."""
    try:
        form: HandForm = published_setup(folder, maps).form()
    except TactileLabError:
        return "not readable", ""
    return f"{form.side}, {len(form.fingers)} fingers", Path(map_name(folder)).stem


def rows(folders: Iterable[Path], maps: Path) -> dict[tuple[str, str, str], list[str]]:
    """Serial numbers of the hands by kind, motor map and outcome."""
    groups = defaultdict[tuple[str, str, str], list[str]](list)
    for folder in folders:
        words = outcome(folder, maps)
        print(f"{folder}: {words}", flush=True)
        groups[*kind(folder, maps), words.replace(f"{folder}/", "").replace(f"{maps}/", "")].append(folder.name)
    return groups


def _file(folder: Path, name: str) -> Path | None:
    """The hand's own file of this name, not that of a template inside its folder."""
    others = [info.parent for info in folder.rglob(INFO_FILE) if info.parent != folder]
    own = [place for place in folder.rglob(name) if not any(map(place.is_relative_to, others))]
    return min(own, default=None)


def _info(folder: Path) -> HandInfo:
    place = folder / INFO_FILE
    return configuration.validate(configuration.load(place), HandInfo, where=str(place))


def main() -> None:
    """Print the table, and store it if requested."""
    options = parser(__doc__)
    options.add_argument("folders", nargs="+", type=Path, help="folders of hands, or above them")
    options.add_argument("--maps", type=Path, required=True, help="folder of Shadow's motor maps (rh_E_v3.yaml ...)")
    chosen = options.parse_args()
    groups = rows(published_folders(chosen.folders), chosen.maps)
    table = GrowingTable(chosen.docs, OUTLINE, sorted(groups))
    for key in sorted(groups):
        table.put(key, (str(len(groups[key])), ", ".join(groups[key])))
    table.publish()


if __name__ == "__main__":
    main()
