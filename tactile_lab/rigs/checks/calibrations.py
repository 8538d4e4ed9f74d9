"""Age of a rig's calibrations, and objections to using them, for ``rig check``."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from calibration.store.admission import Installation, objections
from calibration.store.store import read_record
from drivers.core.calibration_file import is_stored
from drivers.core.configuration import load
from tactile_lab.rigs.checks.findings import Finding

_PLAIN = "plain values of unknown age"


def check_calibrations(files: Mapping[str, Path], here: Installation) -> list[Finding]:
    """One finding for each calibration file of a rig: its age, and reasons why a session would refuse it.

    Args:
        files: role to file.
        here: the installation the calibrations have to belong to.

    Raises:
        ConfigurationError: a file that cannot be read.
    """
    now = datetime.now(UTC)
    against = {each.role: each for each in objections(files, here, now)}
    found = []
    for role, file in files.items():
        words, figures = _age(file, now)
        if objection := against.get(role):
            words = f"{objection.reason}. {objection.hint}"
        found.append(Finding(f"calibration {role}", role not in against, words, figures))
    return found


def check_borrowed(files: Mapping[str, Path], serials: Mapping[str, str]) -> list[Finding]:
    """The same for a rig of single devices, which may borrow the files of any installation, and plain ones.

    Args:
        files: role to file.
        serials: serial numbers by device name, as far as they are known.

    Raises:
        ConfigurationError: a file that cannot be read.
    """
    found: list[Finding] = []
    for role, file in files.items():
        if is_stored(load(file)):
            found += check_calibrations({role: file}, Installation(read_record(file).rig, serials))
        else:
            found.append(Finding(f"calibration {role}", True, _PLAIN))
    return found


def _age(file: Path, now: datetime) -> tuple[str, dict[str, float | str]]:
    if not is_stored(load(file)):
        return _PLAIN, {}
    record = read_record(file)
    days = (now - record.created).total_seconds() / 86400.0
    until = "no expiry" if record.valid_until_utc is None else f"until {record.valid_until_utc}"
    told = {"valid_until_utc": record.valid_until_utc or "", "verdict": record.verdict}
    return f"{days:.1f} days old, valid {until}, {record.method}", {"age_days": days, **told}
