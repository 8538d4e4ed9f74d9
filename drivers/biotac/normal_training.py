"""Trains :mod:`drivers.biotac.learned_normal`, and compares methods for normals on presses not used for training.

Neighbouring samples are nearly equal, so the cross-validation leaves out whole intervals of time.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from drivers.biotac.electrodes import ElectrodeCount, electrode_layout
from drivers.biotac.estimator import contact_from_electrodes, force_direction
from drivers.biotac.learned_normal import (
    KernelSettings,
    LearnedNormals,
    Presses,
    Spread,
    kernel_values,
    patterns,
    usual_normals,
)
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError

STRETCHES = 5
"""Number of intervals of time, each left out once."""

FEWEST = 100
"""Smallest number of presses for a training."""

_SATURATIONS_counts = (20.0, 50.0, 150.0)
_LENGTHS = (0.2, 0.3, 0.4, 0.6, 0.8)
_RIDGES = (0.01, 0.03, 0.1)

_SPREADS_rad = np.radians(np.geomspace(0.2, 40.0, 60))
_WITHIN_68, _WITHIN_95 = np.sqrt(-2.0 * np.log([0.32, 0.05]))
"""Angles, in standard deviations per axis, within which 68 and 95 per cent of normals lie."""


@dataclass(frozen=True)
class MethodErrors:
    """Angles between estimated and measured normals, for one method, on presses it was not trained on.

    Attributes:
        method: its name for people.
        samples: number of presses for which it gave a normal.
        median_deg, ninety_deg: median and 90 % quantile of the angle.
        sigma_deg: median of the standard deviations per axis that the method states.
        within_68, within_95: share of angles within the stated 68 and 95 per cent regions.
    """

    method: str
    samples: int
    median_deg: float
    ninety_deg: float
    sigma_deg: float
    within_68: float
    within_95: float


def angles_rad(estimated: Array, measured: Array) -> Array:
    """Angle between unit vectors, row by row, radians."""
    return np.asarray(np.arccos(np.clip((estimated * measured).sum(axis=1), -1.0, 1.0)))


def rotation_between(source: Array, target: Array) -> Array:
    """Rotation R (3, 3) that best turns unit vectors ``source`` into ``target`` (n, 3) (orthogonal Procrustes)."""
    u, _, vt = np.linalg.svd(target.T @ source)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def rotation_to_sensor(presses: Presses, electrodes: ElectrodeCount, noise_counts: float) -> Array:
    """Rotation reference_R_sensor for normals that were measured in a fixed frame other than the BioTac's.

    It is the rotation for which the normals agree best with those of equation 2.24.
    """
    found = contact_from_electrodes(presses.changes, electrode_layout(electrodes), noise_counts=noise_counts).normals
    known = np.isfinite(found).all(axis=1)
    return rotation_between(found[known], presses.normals[known])


def train(
    presses: Presses, electrodes: ElectrodeCount, *, noise_counts: float = 15.0, most: int = 800
) -> LearnedNormals:
    """Learn normals from presses in chronological order.

    Args:
        presses: at least :data:`FEWEST`.
        electrodes: 19 or 24.
        noise_counts: smaller changes are noise in equation 2.24.
        most: largest number of examples to keep, evenly spread over the recording.

    Raises:
        ConfigurationError: too few presses, or presses with a different number of electrodes.
    """
    _check(presses, electrodes)
    kept = presses.part(np.unique(np.linspace(0, len(presses) - 1, most).astype(int)))
    usual = usual_normals(kept.changes, electrodes, noise_counts, kept.normals.mean(axis=0))
    best: tuple[float, KernelSettings, Spread] | None = None
    for saturation, length, ridge in product(_SATURATIONS_counts, _LENGTHS, _RIDGES):
        kernel = KernelSettings(saturation_counts=saturation, length=length, ridge=ridge)
        found, variance = _predict_left_out(kept, usual, kernel)
        errors = angles_rad(found, kept.normals)
        if best is None or errors.mean() < best[0]:
            best = float(errors.mean()), kernel, fitted_spread(errors, variance)
    assert best is not None
    return LearnedNormals(electrodes, kept, best[1], best[2], noise_counts)


def _check(presses: Presses, electrodes: int) -> None:
    if len(presses) < FEWEST:
        what = f"{len(presses)} presses with a known normal, but {FEWEST} are needed"
        raise ConfigurationError(what, where="BioTac normals", hint="Record more presses, all over the fingertip")
    if presses.changes.shape[1] != electrodes:
        what = f"the presses have {presses.changes.shape[1]} electrodes, not {electrodes}"
        raise ConfigurationError(what, where="BioTac normals", hint="Give the right number of electrodes")


def _predict_left_out(presses: Presses, usual: Array, kernel: KernelSettings) -> tuple[Array, Array]:
    """Normals of each interval predicted from the others (n, 3), and the variances of the regression (n,).

    In closed form, with one inverse for all intervals (Rasmussen and Williams, Gaussian Processes, 5.4.2, block-wise).
    """
    known = patterns(presses.changes, kernel)
    inverse = np.linalg.inv(kernel_values(known, known, kernel) + kernel.ridge * np.eye(len(known)))
    weights = inverse @ (presses.normals - usual)
    found, variance = np.empty_like(presses.normals), np.empty(len(presses))
    for rows in np.array_split(np.arange(len(presses)), STRETCHES):
        covariance = np.linalg.inv(inverse[np.ix_(rows, rows)])
        found[rows] = presses.normals[rows] - covariance @ weights[rows]
        variance[rows] = np.diag(covariance) - kernel.ridge
    return found / np.linalg.norm(found, axis=1, keepdims=True), np.clip(variance, 0.0, 1.0)


def fitted_spread(errors_rad: Array, variance: Array) -> Spread:
    """The most likely spread for angles that are errors about two axes (Rayleigh distributed)."""
    near, far = (grid.reshape(-1, 1) for grid in np.meshgrid(_SPREADS_rad, _SPREADS_rad))
    squared = near**2 + far**2 * variance
    misfit = (np.log(squared) + 0.5 * errors_rad**2 / squared).mean(axis=1)
    chosen = int(misfit.argmin())
    return Spread(near_rad=float(near[chosen, 0]), far_rad=float(far[chosen, 0]))


# --- comparison ----------------------------------------------------------------------------------------------------


def compare_methods(
    presses: Presses,
    electrodes: ElectrodeCount,
    *,
    noise_counts: float = 15.0,
    in_sensor_frame: bool = False,
    most: int = 800,
) -> list[MethodErrors]:
    """Train every method on the first half of the recording and test it on the second.

    Args:
        presses: in chronological order.
        electrodes: 19 or 24.
        noise_counts: smaller changes are noise, for methods that use only squeezed electrodes.
        in_sensor_frame: whether normals are in the BioTac frame; if not, a rotation is fitted for each method on the
            first half.
        most: largest number of examples that the learned method keeps.

    Raises:
        ConfigurationError: too few presses, or presses that no electrode feels.
    """
    _check(presses, electrodes)
    half, layout = len(presses) // 2, electrode_layout(electrodes)
    ways = {
        "equation 2.24, all electrodes": _all_electrodes(presses.changes, electrodes, 1.0),
        "equation 2.24, all electrodes, squared": _all_electrodes(presses.changes, electrodes, 2.0),
        "equation 2.24, squeezed electrodes": contact_from_electrodes(
            presses.changes, layout, noise_counts=noise_counts
        ).normals,
        "sum of squeezed normals": force_direction(presses.changes, layout, noise_counts=noise_counts),
    }
    rows = [_score(name, normals, presses.normals, half, in_sensor_frame) for name, normals in ways.items()]
    return [*rows, _judged_learning(presses, electrodes, noise_counts, half, in_sensor_frame, most)]


def _all_electrodes(changes: Array, electrodes: ElectrodeCount, power: float) -> Array:
    """Skin normals by equation 2.24 as the thesis states it: changes of either sign count."""
    weights, layout = np.abs(changes) ** power, electrode_layout(electrodes)
    with np.errstate(invalid="ignore"):
        return layout.skin.project(weights @ layout.positions_m / weights.sum(axis=1, keepdims=True))[1]


def _score(name: str, found: Array, measured: Array, half: int, in_sensor_frame: bool) -> MethodErrors:
    known = np.asarray(np.isfinite(found).all(axis=1))
    first, second = np.flatnonzero(known[:half]), half + np.flatnonzero(known[half:])
    if not (len(first) and len(second)):
        what = "in half of the recording no press changes an electrode by more than its noise"
        raise ConfigurationError(what, where="BioTac normals", hint="Check the sensor, and record again")
    turn = np.eye(3) if in_sensor_frame else rotation_between(found[first], measured[first])
    trained = angles_rad(found[first] @ turn.T, measured[first])
    sigma = np.full(len(second), np.sqrt(0.5 * np.mean(trained**2)))
    return _errors(name, angles_rad(found[second] @ turn.T, measured[second]), sigma)


def _judged_learning(
    presses: Presses, electrodes: ElectrodeCount, noise_counts: float, half: int, in_sensor_frame: bool, most: int
) -> MethodErrors:
    first, second = presses.part(slice(0, half)), presses.part(slice(half, None))
    turn = np.eye(3) if in_sensor_frame else rotation_to_sensor(first, electrodes, noise_counts)
    learned = train(Presses(first.changes, first.normals @ turn), electrodes, noise_counts=noise_counts, most=most)
    found, sigma = learned.normals(second.changes)
    return _errors("learned", angles_rad(found @ turn.T, second.normals), sigma)


def _errors(name: str, angles: Array, sigma: Array) -> MethodErrors:
    median, ninety = np.degrees(np.quantile(angles, (0.5, 0.9)))
    return MethodErrors(
        method=name,
        samples=len(angles),
        median_deg=float(median),
        ninety_deg=float(ninety),
        sigma_deg=float(np.degrees(np.median(sigma))),
        within_68=float((angles < _WITHIN_68 * sigma).mean()),
        within_95=float((angles < _WITHIN_95 * sigma).mean()),
    )
