"""Algorithm 3.1: one particle filter, one map, updated at the estimated pose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.shape.fields.field_grid import Field
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, compose, inverse
from tactile_lab.slam.tracking.filter.measurement import Known, Measurement
from tactile_lab.slam.tracking.filter.particle_filter import Belief, PoseEstimate


class ParticleTracker:
    """The thesis's filter; the measurement model distinguishes the printed form from the calibrated one."""

    def __init__(
        self,
        first: ContactMap,
        measurement: Measurement,
        noise: MotionNoise,
        particles: int,
        kernel_every: int,
        field_of: Callable[[ContactMap], Field],
        rng: np.random.Generator,
    ) -> None:
        """
        Args:
            first: map of the first grasp.
            measurement: the measurement model.
            noise: of the motion model.
            particles: their number.
            kernel_every: kernel parameters are estimated again after this many grasps.
            field_of: makes the field that particles are compared with.
            rng: source of all random numbers.
        """
        self._map, self._measurement, self._noise, self._rng = first, measurement, noise, rng
        self._kernel_every, self._field_of = kernel_every, field_of
        self._belief = Belief.certain(first.placed[-1].pose, particles)
        self._motion = np.zeros(3)
        self._motion_sigma: StepSigma | None = None
        self.effective_count = float(particles)

    @property
    def map(self) -> ContactMap:
        return self._map

    @property
    def refined(self) -> ContactMap:
        return self._map

    def predict(self, motion: Array, measured: StepSigma | None = None) -> None:
        self._motion, self._motion_sigma = motion, measured
        noise = self._noise if measured is None else self._noise.after(motion, measured)
        self._belief = self._belief.predict(motion, noise, self._rng)

    def weigh(self, contacts: ContactSet) -> bool:
        if len(contacts) == 0:
            return False
        previous = self._map.contacts_of(self._map.last_used)
        known = Known(self._field_of(self._map), previous, self._map.contacts)
        weighted = self._belief.weight(self._measurement.log_likelihood(self._belief.rows, contacts, known))
        self._belief = weighted or self._belief
        self.effective_count = self._belief.effective_count
        return weighted is not None

    def estimate(self) -> PoseEstimate:
        return self._belief.estimate()

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        estimate = self.estimate()
        grasp = PlacedGrasp(contacts, estimate.pose, estimate.covariance, self._motion, motion_sigma=self._motion_sigma)
        self._map = self._map.with_grasp(grasp if certain else grasp.put_aside())
        if certain and len(self._map.placed) % self._kernel_every == 0:
            self._map = self._map.with_best_kernel()

    def resample(self) -> None:
        self._belief = self._belief.resample(self._rng)

    def adopt(self, corrected: ContactMap) -> None:
        """Take over poses corrected by the graph; the particles move along with the last pose."""
        change = compose(corrected.placed[-1].pose, inverse(self._map.placed[-1].pose))
        self._belief = Belief(compose(change, self._belief.rows), self._belief.weights)
        self._map = corrected

    def finish(self) -> None:
        """Nothing to do: a filter does not revise earlier estimates."""
