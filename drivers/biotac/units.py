"""BioTac counts in physical units (manufacturer's manual, protocols D.2). Arrays of any shape.

Temperatures are those of the heated core and approximate; only their changes mean something.
"""

from __future__ import annotations

import numpy as np

from tactile_lab.geometry.contacts import Array

FULL_SCALE = 4095.0
_REFERENCE_ohm = 10_000.0
_PDC_kPa, _PAC_Pa = 0.0365, 0.37


def electrode_ohm(counts: Array) -> Array:
    """Impedance of an electrode, ohm; infinite at zero counts."""
    with np.errstate(divide="ignore"):
        return np.asarray((FULL_SCALE / np.asarray(counts, float) - 1.0) * _REFERENCE_ohm)


def pressure_kPa(counts: Array, untouched_counts: Array) -> Array:
    """Static fluid pressure above the untouched one, kPa."""
    return np.asarray((np.asarray(counts, float) - untouched_counts) * _PDC_kPa)


def vibration_Pa(counts: Array, rest_counts: Array) -> Array:
    """Dynamic fluid pressure, pascal."""
    return np.asarray((np.asarray(counts, float) - rest_counts) * _PAC_Pa)


def core_temperature_degC(counts: Array) -> Array:
    """Temperature of the core from the TDC channel, degrees Celsius."""
    return np.asarray(4025.0 / _log_ratio(counts) - 273.15)


def heat_flow_degC(counts: Array) -> Array:
    """The TAC channel, degrees Celsius; a change signal."""
    return np.asarray(-41.07 / _log_ratio(counts))


def _log_ratio(counts: Array) -> Array:
    x = np.asarray(counts, float) / FULL_SCALE
    with np.errstate(divide="ignore"):
        return np.asarray(np.log((155183.0 - 46555.0 * x) / x))
