"""ATI calibration files, which convert gauge readings to force and torque (protocols: ATI calibration files).

There are two families: the ``.cal`` files of DAQ sensors, in version 1.0 (internal ``Axis`` rows and a transform) or
1.1 (``UserAxis`` rows as well), and the XML file of a Net F/T box.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.ati.protocols.xml_text import LARGEST, parse_xml
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import read_bounded

AXES = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
FORCE_UNITS_N = {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605, "klbf": 4448.2216152605, "kg": 9.80665, "g": 9.80665e-3}
LENGTH_UNITS_m = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
TORQUE_UNITS_Nm = {
    "N-m": 1.0,
    "Nm": 1.0,
    "N-mm": 1e-3,
    "Nmm": 1e-3,
    "kN-m": 1e3,
    "lbf-in": 4.4482216152605 * 0.0254,
    "lbf-ft": 4.4482216152605 * 0.3048,
    "kg-cm": 9.80665e-2,
}


@dataclass(frozen=True)
class TemperatureTerms:
    """Correction of the gauges by the thermistor: (V + bias_slope (T - T0)) / (1 - gain_slope (T - T0)).

    Attributes:
        bias_slopes, gain_slopes: of each gauge, shape (6,).
        thermistor_V: T0, the thermistor's reading at calibration.
    """

    bias_slopes: Array
    gain_slopes: Array
    thermistor_V: float

    def correct(self, volts: Array, thermistor_V: Array) -> Array:
        """Gauge volts (..., 6), corrected to the temperature of the calibration; ``thermistor_V`` (...,)."""
        off = (thermistor_V - self.thermistor_V)[..., None]
        return np.asarray((volts + self.bias_slopes * off) / (1.0 - self.gain_slopes * off))


@dataclass(frozen=True)
class AtiCalibration:
    """One sensor's calibration.

    Attributes:
        serial, part_number, family: as written in the file.
        force_unit, torque_unit: units of ``matrix``, as written in the file.
        matrix: working matrix, shape (6, 6): readings of the six gauges to force and torque, in the file's units. The
            reading is volts for a DAQ sensor and counts for a Net F/T box.
        user_rows: the file's own working matrix (version 1.1), or None.
        ranges: calibrated range of each axis, file's units, shape (6,).
        output_range_V: span of the amplifier's output: 20 for +-10 V; None for a Net F/T box.
        temperature: how the gauges depend on the temperature; None if the file does not say.
        calibrated: the date, as written in the file.
    """

    serial: str
    part_number: str
    family: str
    force_unit: str
    torque_unit: str
    matrix: Array
    user_rows: Array | None
    ranges: Array
    output_range_V: float | None = None
    temperature: TemperatureTerms | None = None
    calibrated: str = ""

    @property
    def working_matrix(self) -> Array:
        """Matrix from gauge readings to newtons and newton metres, shape (6, 6); from ``UserAxis`` rows if present."""
        rows = self.matrix if self.user_rows is None else self.user_rows
        return np.asarray(rows * self._si[:, None])

    @property
    def ranges_SI(self) -> Array:
        """Calibrated range of each axis in newtons and newton metres, shape (6,)."""
        return np.asarray(self.ranges * self._si)

    @property
    def _si(self) -> Array:
        return np.repeat([FORCE_UNITS_N[self.force_unit], TORQUE_UNITS_Nm[self.torque_unit]], 3)


def load(path: Path) -> AtiCalibration:
    """Read a calibration file of either family and version.

    Raises:
        ConfigurationError: the file cannot be read, is not a calibration, contains a document type or entities, or is
            incomplete.
    """
    root = _parse(path)
    try:
        if root.tag == "FTSensor":
            return _daq_sensor(root)
        if root.tag == "dsNetFTCalibrationFile":
            return _net_box(root)
    except KeyError as error:
        raise _damaged(f"{error.args[0]} is missing", path) from error
    except ValueError as error:
        raise _damaged(str(error), path) from error
    raise ConfigurationError(
        f"is not an ATI calibration (root element {root.tag})", where=str(path), hint="Give a .cal or Net F/T XML file"
    )


def _damaged(reason: str, path: Path) -> ConfigurationError:
    what = f"calibration is incomplete or damaged ({reason})"
    return ConfigurationError(what, where=str(path), hint="Take the file that came with the sensor")


def _parse(path: Path) -> ET.Element:
    try:
        return parse_xml(read_bounded(path, LARGEST))
    except OSError as error:
        raise ConfigurationError(f"cannot be read ({error.strerror})", where=str(path)) from error
    except ValueError as error:
        raise ConfigurationError(str(error), where=str(path), hint="Use ATI's own file") from error


def _daq_sensor(root: ET.Element) -> AtiCalibration:
    calibration = _child(root, "Calibration")
    force_unit, torque_unit = calibration.attrib["ForceUnits"], calibration.attrib["TorqueUnits"]
    _check_units(force_unit, torque_unit)
    axes = {axis.attrib["Name"]: axis for axis in calibration.iter("Axis")}
    internal = np.array([_numbers(axes[n].attrib["values"], 6) / _number(axes[n].attrib["scale"]) for n in AXES])
    shift = _child(calibration, "BasicTransform").attrib
    unit = _length_ratio(force_unit, torque_unit, calibration.attrib["DistUnits"])
    transform = tool_transform(
        unit * np.array([_number(shift[n]) for n in ("Dx", "Dy", "Dz")]),
        np.radians([_number(shift[n]) for n in ("Rx", "Ry", "Rz")]),
    )
    user = {axis.attrib["Name"]: axis for axis in calibration.iter("UserAxis")}
    return AtiCalibration(
        serial=root.attrib["Serial"],
        part_number=calibration.attrib["PartNumber"],
        family=root.attrib["Family"],
        force_unit=force_unit,
        torque_unit=torque_unit,
        matrix=transform @ internal,
        user_rows=np.array([_numbers(user[n].attrib["values"], 6) for n in AXES]) if user else None,
        ranges=np.array([_number(axes[n].attrib["max"]) for n in AXES]),
        output_range_V=_number(calibration.attrib.get("OutputRange", "20")),
        temperature=_temperature_terms(calibration),
        calibrated=calibration.attrib.get("CalDate", ""),
    )


def _temperature_terms(calibration: ET.Element) -> TemperatureTerms | None:
    """The terms in the file, if any: most files of sensors that compensate in hardware have none."""
    bias, gain, thermistor = (calibration.find(tag) for tag in ("BiasSlope", "GainSlope", "Thermistor"))
    if bias is None or gain is None or thermistor is None:
        return None
    return TemperatureTerms(
        bias_slopes=_numbers(bias.attrib["values"], 6),
        gain_slopes=_numbers(gain.attrib["values"], 6),
        thermistor_V=_number(thermistor.attrib["value"]),
    )


def _net_box(root: ET.Element) -> AtiCalibration:
    sensor, part = _child(root, "tblNetFTCalibrationInfo"), _child(root, "tblCalibrationInformation")
    force_unit, torque_unit = _text(part, "ForceUnits"), _text(part, "TorqueUnits")
    _check_units(force_unit, torque_unit)
    by_name = {element.tag.lower(): element.text or "" for element in sensor}
    rows = np.array([_numbers(by_name[f"matrix{name.lower()}"], 6) for name in AXES])
    per_unit = np.repeat([_number(_text(part, "CountsPerForce")), _number(_text(part, "CountsPerTorque"))], 3)
    return AtiCalibration(
        serial=_text(sensor, "SerialNumber"),
        part_number=_text(part, "CalibrationPartNumber"),
        family=_text(sensor, "Family"),
        force_unit=force_unit,
        torque_unit=torque_unit,
        matrix=rows / per_unit[:, None],
        user_rows=None,
        ranges=_numbers(_text(part, "MaxRatings"), 6),
    )


def tool_transform(displacement: Array, rotation_rad: Array) -> Array:
    """Matrix (6, 6) that transforms a wrench into a tool frame: first the displacement, then the rotation.

    This is the order of ATI's own files (protocols: ATI calibration files).

    Args:
        displacement: tool origin in the sensor frame, shape (3,), in torque unit per force unit.
        rotation_rad: about x, then y, then z, shape (3,).
    """
    (cx, cy, cz), (sx, sy, sz) = np.cos(rotation_rad), np.sin(rotation_rad)
    rotation = np.array(
        [
            [cy * cz, sx * sy * cz + cx * sz, sx * sz - cx * sy * cz],
            [-cy * sz, -sx * sy * sz + cx * cz, sx * cz + cx * sy * sz],
            [sy, -sx * cy, cx * cy],
        ]
    )
    dx, dy, dz = displacement
    lever = np.array([[0.0, dz, -dy], [-dz, 0.0, dx], [dy, -dx, 0.0]])
    return np.block([[rotation, np.zeros((3, 3))], [rotation @ lever, rotation]])


def _length_ratio(force_unit: str, torque_unit: str, length_unit: str) -> float:
    """One length unit in (torque unit / force unit): 1 for N, N mm and mm."""
    if length_unit not in LENGTH_UNITS_m:
        raise ValueError(f"unknown length unit {length_unit!r}")
    return LENGTH_UNITS_m[length_unit] * FORCE_UNITS_N[force_unit] / TORQUE_UNITS_Nm[torque_unit]


def _check_units(force_unit: str, torque_unit: str) -> None:
    if force_unit not in FORCE_UNITS_N or torque_unit not in TORQUE_UNITS_Nm:
        raise ValueError(f"unknown units {force_unit!r}, {torque_unit!r}")


def _child(parent: ET.Element, tag: str) -> ET.Element:
    if (child := parent.find(tag)) is None:
        raise KeyError(tag)
    return child


def _text(parent: ET.Element, tag: str) -> str:
    return (_child(parent, tag).text or "").strip()


def _number(text: str) -> float:
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise ValueError(f"{text!r} is not a finite number")


def _numbers(text: str, count: int) -> Array:
    values = np.array([_number(word) for word in text.split()])
    if len(values) != count:
        raise ValueError(f"{len(values)} numbers instead of {count}")
    return values
