"""The interface of all trackers."""

from __future__ import annotations

from typing import Protocol

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.filter.particle_filter import PoseEstimate


class Tracker(Protocol):
    """Follows the object from grasp to grasp; the calls of one step come in this order."""

    @property
    def effective_count(self) -> float:
        """Effective number of particles or hypotheses after the last weighting."""

    @property
    def map(self) -> ContactMap:
        """All grasps so far with their present poses."""

    @property
    def refined(self) -> ContactMap:
        """The same with refinements that take too long for every step, for the shape shown between grasps."""

    def predict(self, motion: Array, measured: StepSigma | None = None) -> None:
        """Move the belief by the hand's motion (eq. 3.7), known as well as ``measured`` says."""

    def weigh(self, contacts: ContactSet) -> bool:
        """Weight the belief by a grasp's contacts in the world (eq. 3.6); returns False if nothing fits."""

    def estimate(self) -> PoseEstimate:
        """The present pose."""

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        """Add the grasp to the map. A tracker with one hypothesis keeps uncertain contacts out of the shape."""

    def resample(self) -> None:
        """Concentrate the belief on likely states."""

    def adopt(self, corrected: ContactMap) -> None:
        """Take over a map whose poses were corrected from outside."""

    def finish(self) -> None:
        """No further grasp follows: final estimation from all of them."""
