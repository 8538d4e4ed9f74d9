"""Makes faces as regular as contacts and motion allow, while the poses adapt.

With fixed poses, an error of a pose looks like an oblique face. So the uncertainty of the faces here includes that of
all poses: it decides which faces are parallel, perpendicular, upright or level.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.regularities import offsets_of_faces, regular_normals
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces, tangents


def made_regular(contact_map: ContactMap, faces: FlatFaces, information: Array) -> FlatFaces:
    """The faces of a map turned to be regular, each where its contacts are.

    Args:
        contact_map: with contacts where its poses have them.
        faces: fitted to these.
        information: by all poses but the first, then by each face's tilt and offset, square.
    """
    on_table = contact_map.space is PLANAR and contact_map.dimension == 3
    known = _covariance_of_normals(faces.normals, information)
    found = regular_normals(faces.normals, known, upright=on_table)
    seen = contact_map.contacts
    offsets_m = offsets_of_faces(seen.points_m, seen.point_sigma_m, faces.labels, found.normals)
    return replace(faces, normals=found.normals, offsets_m=offsets_m, regularities=found.regularities)


def _covariance_of_normals(normals: Array, information: Array) -> Array:
    """Of all their components, shape (s d, s d), square radians."""
    (count, dimension), turned = normals.shape, tangents(normals)
    covariance = np.linalg.inv(information)[-normals.size :, -normals.size :]
    of_tilts = covariance.reshape(count, dimension, count, dimension)[:, :-1, :, :-1]
    spread = np.einsum("sdt,stru,reu->sdre", turned, of_tilts, turned)
    return np.asarray(spread.reshape(normals.size, normals.size))
