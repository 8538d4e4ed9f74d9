"""The contact normal learned from presses with known normals, with a standard deviation for each prediction.

Kernel ridge regression on the pattern of all electrodes. It learns the error of equation 2.24, that is, of the skin's
normal at the point which this equation gives. Far from all recorded patterns the prediction falls back to equation
2.24, and the stated standard deviation grows to the one observed there.
"""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.biotac.electrodes import ElectrodeCount, electrode_layout
from drivers.biotac.estimator import contact_from_electrodes
from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel
from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import ConfigurationError

PositiveFloat = Annotated[float, Field(gt=0.0)]


class KernelSettings(StrictModel):
    """Parameters of the regression's kernel; chosen by cross-validation.

    Attributes:
        saturation_counts: patterns are divided by their norm plus this value, so that light and hard presses look
            alike.
        length: of the squared exponential kernel between patterns.
        ridge: weight of the penalty, against a kernel of 1 at distance 0.
    """

    saturation_counts: PositiveFloat
    length: PositiveFloat
    ridge: PositiveFloat


class Spread(StrictModel):
    """Standard deviation of a prediction per axis, radians: ``near`` at a recorded pattern, plus ``far`` in quadrature.

    The square of ``far`` is weighted by the regression's variance: 0 at recorded patterns, 1 far from all of them.
    """

    near_rad: PositiveFloat
    far_rad: float = Field(ge=0.0)

    def sigma_rad(self, variance: Array) -> Array:
        """The standard deviation for each variance."""
        return np.sqrt(self.near_rad**2 + self.far_rad**2 * variance)


@dataclass(frozen=True, eq=False)
class Presses:
    """Presses with a known normal, BioTac frame.

    Attributes:
        changes: electrode readings minus their tare, counts, shape (n, electrodes).
        normals: the skin's outward unit normal at the contact, shape (n, 3).
    """

    changes: Array
    normals: Array

    def __len__(self) -> int:
        return len(self.changes)

    def part(self, rows: slice | Array) -> Presses:
        """A subset of the presses."""
        return Presses(self.changes[rows], self.normals[rows])


@dataclass(frozen=True, eq=False)
class LearnedNormals:
    """A trained regression.

    Attributes:
        electrodes: 19 or 24.
        examples: the presses that it keeps.
        kernel: parameters of the kernel.
        spread: standard deviation of its predictions.
        noise_counts: smaller changes are noise in equation 2.24.
    """

    electrodes: ElectrodeCount
    examples: Presses
    kernel: KernelSettings
    spread: Spread
    noise_counts: float

    def normals(self, changes: Array) -> tuple[Array, Array]:
        """Outward unit normals (n, 3) in the BioTac frame and their spread per axis (n,), radians.

        Args:
            changes: electrode readings minus their tare, counts, shape (n, electrodes).
        """
        likeness = kernel_values(
            patterns(changes, self.kernel), patterns(self.examples.changes, self.kernel), self.kernel
        )
        found = self._usual(changes) + likeness @ self._weights
        told = np.einsum("ij,jk,ik->i", likeness, self._inverse, likeness)
        sigma = self.spread.sigma_rad(np.clip(1.0 - told, 0.0, 1.0))
        return found / np.linalg.norm(found, axis=1, keepdims=True), sigma

    def _usual(self, changes: Array) -> Array:
        return usual_normals(changes, self.electrodes, self.noise_counts, self.examples.normals.mean(axis=0))

    @cached_property
    def _inverse(self) -> Array:
        known = patterns(self.examples.changes, self.kernel)
        return np.asarray(
            np.linalg.inv(kernel_values(known, known, self.kernel) + self.kernel.ridge * np.eye(len(known)))
        )

    @cached_property
    def _weights(self) -> Array:
        return np.asarray(self._inverse @ (self.examples.normals - self._usual(self.examples.changes)))


def patterns(changes: Array, kernel: KernelSettings) -> Array:
    """Electrode changes scaled to a norm below one, shape as ``changes``."""
    return np.asarray(changes / (np.linalg.norm(changes, axis=1, keepdims=True) + kernel.saturation_counts))


def kernel_values(a: Array, b: Array, kernel: KernelSettings) -> Array:
    """Squared exponential kernel between patterns, shape (len(a), len(b))."""
    squared = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1)[None] - 2.0 * a @ b.T
    return np.asarray(np.exp(-0.5 * np.maximum(squared, 0.0) / kernel.length**2))


def usual_normals(changes: Array, electrodes: ElectrodeCount, noise_counts: float, otherwise: Array) -> Array:
    """Normals of equation 2.24 (n, 3); ``otherwise`` where no electrode is squeezed."""
    found = contact_from_electrodes(changes, electrode_layout(electrodes), noise_counts=noise_counts).normals
    return np.where(np.isfinite(found).all(axis=1, keepdims=True), found, otherwise)


# --- file format ---------------------------------------------------------------------------------------------------


class StoredNormals(StrictModel):
    """A regression as stored in a file: numbers are little-endian 32-bit floats in base 64, row by row."""

    electrodes: ElectrodeCount
    kernel: KernelSettings
    spread: Spread
    noise_counts: float = Field(ge=0.0)
    examples: int = Field(gt=0)
    changes_base64: str
    normals_base64: str


class NormalsFile(StrictModel):
    """Parameters of a calibration of kind ``normals``: finger to regression."""

    normals: Annotated[dict[str, StoredNormals], Field(min_length=1)]


def as_stored(learned: LearnedNormals) -> StoredNormals:
    """A regression in the form that is stored."""
    return StoredNormals(
        electrodes=learned.electrodes,
        kernel=learned.kernel,
        spread=learned.spread,
        noise_counts=learned.noise_counts,
        examples=len(learned.examples),
        changes_base64=_pack(learned.examples.changes),
        normals_base64=_pack(learned.examples.normals),
    )


def load_normals(path: Path) -> dict[str, LearnedNormals]:
    """Read a calibration of kind ``normals``: finger to regression.

    Raises:
        ConfigurationError: the contents do not fit; the message says how.
    """
    found = load_parameters(path, NormalsFile).normals
    if unknown := sorted(set(found) - set(FINGERS)):
        hint = f"The fingers are {', '.join(FINGERS)}"
        raise ConfigurationError(f"unknown finger {', '.join(unknown)}", where=str(path), hint=hint)
    return {finger: _restore(each, f"{path}: normals.{finger}") for finger, each in found.items()}


def _restore(file: StoredNormals, where: str) -> LearnedNormals:
    changes = _unpack(file.changes_base64, (file.examples, file.electrodes), where)
    normals = _unpack(file.normals_base64, (file.examples, 3), where)
    return LearnedNormals(file.electrodes, Presses(changes, normals), file.kernel, file.spread, file.noise_counts)


def _pack(values: Array) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode()


def _unpack(text: str, shape: tuple[int, int], where: str) -> Array:
    try:
        values = np.frombuffer(base64.b64decode(text, validate=True), "<f4").reshape(shape).astype(float)
    except (binascii.Error, ValueError) as error:
        hint = "Train again with tactile-lab calibrate biotac"
        raise ConfigurationError(
            f"does not have {shape[0]} rows of {shape[1]} numbers", where=where, hint=hint
        ) from error
    if not np.isfinite(values).all():
        raise ConfigurationError("contains values that are not numbers", where=where, hint="Train again")
    return values
