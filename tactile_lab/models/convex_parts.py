"""A solid as a few convex parts, as physics engines want them of a model."""

from __future__ import annotations

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.installed.extras import require_package

MOST_PARTS = 16

_NEARLY_CONVEX = 0.96
"""A solid that fills this share of its convex hull is represented by the hull."""


def convex_parts(mesh: trimesh.Trimesh) -> tuple[Array, ...]:
    """Corner points of convex parts, each of shape (n, 3), whose union covers a closed mesh.

    A nearly convex mesh is one part, its hull. Others are decomposed by CoACD with a fixed seed, so that one file gives
    the same parts every time; that takes seconds. Hollows are covered by millimetres.
    """
    if mesh.volume >= _NEARLY_CONVEX * mesh.convex_hull.volume:
        return (np.asarray(mesh.convex_hull.vertices, float),)
    require_package("coacd")
    import coacd

    coacd.set_log_level("error")
    pieces = coacd.run_coacd(
        coacd.Mesh(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int32)),
        threshold=0.05,
        max_convex_hull=MOST_PARTS,
        preprocess_mode="off",
        resolution=1000,
        mcts_nodes=10,
        mcts_iterations=20,
        mcts_max_depth=2,
        seed=1,
    )
    return tuple(np.asarray(corners, float) for corners, _ in pieces)
