"""Readings of a force sensor, the bias taken from them, and how a force fingertip judges them."""

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
        faults: what is wrong with the reading, in words; the reading is void when there is anything.
        remarks: what the device says besides that leaves the reading usable.
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
        moved: how far the bias is from the one before, shape (6,); None for the first.
        since_s: seconds since the one before.
    """

    stamp_ns: int
    reason: str
    samples: int
    bias: Array
    moved: Array | None = None
    since_s: float = 0.0


class ForceTipSettings(StrictModel):
    """How a force fingertip judges its samples.

    Attributes:
        force_range_N, torque_range_Nm: the calibration's range per axis, that of an SI-12-0.12 unless given
            (protocols: Nano17 ratings); a reading beyond it is void.
        contact_force_N: below this force no contact is computed (several times the drift).
        minimum_samples: samples a capture needs.
        tare_samples: the newest samples that a tare averages.
        tare_spread_N, tare_spread_Nm: how far they may lie apart, largest minus smallest on any axis.
        lost_share: share of lost records that is reported as a problem.
        limit_share: a reading beyond this share of the range, on any axis, counts as an infinite load, so that motion
            stops: what a Nano17 survives beyond its range is not published.
        drift_limit_N, drift_limit_Nm: a bias that has moved farther since the tare before is reported.
        plausibility: limits of what one contact can do.
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
