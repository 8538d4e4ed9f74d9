"""Similar grasps: grasps that touched the same faces of the object (thesis section 3.3.3.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.observability import planar_observability
from tactile_lab.slam.graph.faces import NO_FACE, Labels
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

Indices = NDArray[np.intp]


class SimilaritySettings(StrictModel):
    """When two grasps are similar.

    Attributes:
        least_faces: shared faces; the thesis asks for three.
        least_eigenvalue: smallest eigenvalue of (3.18) over the shared contacts, lengths scaled by 30 mm.
    """

    least_faces: int = Field(default=3, ge=1)
    least_eigenvalue: float = Field(default=0.15, ge=0)


@dataclass(frozen=True)
class SharedContacts:
    """Contacts of two grasps on the same faces, paired.

    Attributes:
        earlier, later: indices of equal length into the contacts; entry k of both lies on the same face.
        faces: number of different faces.
        eigenvalue: smallest eigenvalue of (3.18) of the earlier contacts.
        similar: enough faces and observable.
        reason: why not; empty if similar.
    """

    earlier: Indices
    later: Indices
    faces: int
    eigenvalue: float
    similar: bool
    reason: str


def shared_contacts(
    contacts: ContactSet, faces: Labels, earlier: Indices, later: Indices, settings: SimilaritySettings
) -> SharedContacts:
    """Pair each contact of the later grasp with the nearest of the earlier one on the same face.

    Args:
        contacts: contacts of all grasps, object frame, as placed so far.
        faces: the face of each contact.
        earlier, later: indices of the two grasps' contacts.
        settings: the criteria.
    """
    pairs = [_partner(contacts, faces, earlier, index) for index in later if faces[index] != NO_FACE]
    found = np.array([pair for pair in pairs if pair is not None], dtype=np.intp).reshape(-1, 2)
    ours, theirs = found[:, 0], found[:, 1]
    count = len(np.unique(faces[ours]))
    eigenvalue = planar_observability(contacts.points_m[ours], contacts.normals[ours]).smallest if len(ours) else 0.0
    reason = ""
    if count < settings.least_faces:
        reason = f"{count} shared faces, {settings.least_faces} needed"
    elif eigenvalue < settings.least_eigenvalue:
        reason = f"not observable (eigenvalue {eigenvalue:.2f} below {settings.least_eigenvalue:.2f})"
    return SharedContacts(ours, theirs, count, eigenvalue, not reason, reason)


def _partner(
    contacts: ContactSet, faces: Labels, candidates: Indices, index: np.intp
) -> tuple[np.intp, np.intp] | None:
    same = candidates[faces[candidates] == faces[index]]
    if len(same) == 0:
        return None
    distances = np.linalg.norm(contacts.points_m[same] - contacts.points_m[index], axis=1)
    return same[int(distances.argmin())], index
