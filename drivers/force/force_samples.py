"""Samples of a force sensor, tares, and their limits."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.force.plausibility import PlausibilitySettings


@dataclass(frozen=True)
class WrenchSample:
    """One reading of a force sensor.

    Attributes:
        stamp_ns: arrival at the host.
        wrench: what acts on the fingertip, its weight and the sensor's bias included: force (N) then torque (N m),
            shape (6,), sensor frame.
        sent, measured: the device's counters of sent and of measured records.
        status: the device's own status word as it came, 0 when healthy.
        faults: faults of the reading as text; any fault makes it invalid.
        remarks: other messages of the device that leave the reading usable.
    """

    stamp_ns: int
    wrench: Array
    sent: int
    measured: int
    status: int = 0
    faults: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tare:
    """When and why the bias was taken.

    Attributes:
        stamp_ns, reason, samples: of the newest sample, for people, and how many were averaged.
        bias: shape (6,), N and N m, sensor frame, without the tip's weight.
        moved: change of the bias since the previous tare, shape (6,); None for the first.
        since_s: seconds since the previous tare.
    """

    stamp_ns: int
    reason: str
    samples: int
    bias: Array
    moved: Array | None = None
    since_s: float = 0.0


class ForceTipSettings(StrictModel):
    """Limits of a force fingertip's samples.

    Attributes:
        force_range_N, torque_range_Nm: the calibration's range per axis, that of an SI-12-0.12 unless given (protocols:
            Nano17 ratings); a reading beyond it is invalid.
        contact_force_N: below this force no contact is computed (several times the drift).
        minimum_samples: samples a capture needs.
        tare_samples: the newest samples that a tare averages.
        tare_spread_N, tare_spread_Nm: their largest spread, maximum minus minimum on any axis.
        lost_share: share of lost records that is reported as a problem.
        limit_share: a reading beyond this share of the range, on any axis, counts as an infinite load, so that motion
            stops: a Nano17's overload limits are not published.
        drift_limit_N, drift_limit_Nm: a larger change of the bias since the previous tare is reported.
        plausibility: limits of a single contact.
    """

    force_range_N: tuple[float, float, float] = (12.0, 12.0, 17.0)
    torque_range_Nm: tuple[float, float, float] = (0.12, 0.12, 0.12)
    contact_force_N: float = Field(default=0.08, gt=0.0)
    minimum_samples: int = Field(default=3, ge=1)
    tare_samples: int = Field(default=20, ge=2)
    tare_spread_N: float = Field(default=0.05, gt=0.0)
    tare_spread_Nm: float = Field(default=5e-4, gt=0.0)
    lost_share: float = Field(default=0.01, ge=0.0)
    limit_share: float = Field(default=0.8, gt=0.0, le=1.0)
    drift_limit_N: float = Field(default=0.1, gt=0.0)
    drift_limit_Nm: float = Field(default=1e-3, gt=0.0)
    plausibility: PlausibilitySettings = PlausibilitySettings()
