"""The scene of a session as objects of viser's page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import CLOSINGS, closing
from drivers.shadow.closing.posture import HandShape
from sessions.recording.traffic import foxglove
from sessions.recording.traffic.told import ToldSurface
from tactile_lab.colours import SIGMA_FULL_m, viridis
from tactile_lab.outline_walls import wall
from tactile_lab.view.scene import Scene, ellipse
from tactile_lab.view.skeleton import TIP_CENTRE_m, bones, shown_form

TIP_RADIUS_m = 0.0085
_BONE, _IDLE, _TOUCHING, _SILENT = (120, 126, 138), (150, 158, 170), (46, 160, 67), (240, 170, 30)
_NEXT, _POSE, _CONTACT = (214, 90, 160), (31, 111, 235), (200, 40, 40)
_PALM_m, _PALM_CENTRE_m = (0.085, 0.022, 0.088), np.array([0.0, 0.0, 0.048])
_FORCE_SCALE_m_N = 0.025
_UP = np.array([0.0, 0.0, 1.0])


COLOURS = 12
"""Steps of the colour map on a surface."""


@dataclass(frozen=True)
class Patch:
    """A part of a surface with one colour: vertices (n, 3), faces (m, 3), red green blue."""

    vertices_m: Array
    faces: Any
    colour: tuple[int, int, int]


class Drawing:
    """Draws what has changed.

    Args:
        server: the page.
        distance: initial camera distance, as a multiple of the one that shows a hand at an object.
    """

    def __init__(self, server: viser.ViserServer, distance: float = 1.0) -> None:
        self._scene = server.scene
        self._nodes: dict[str, list[Any]] = {}
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(True, cast_shadow=False)
        server.scene.add_grid(
            "/table",
            0.6,
            0.6,
            cell_size=0.02,
            section_size=0.1,
            cell_color=(222, 226, 232),
            section_color=(190, 197, 206),
        )
        server.scene.add_frame("/world", axes_length=0.04, axes_radius=0.0012)
        middle, eye = np.array([0.045, -0.03, 0.075]), np.array([-0.325, -0.34, 0.235])  # the panel covers the right
        server.initial_camera.position = middle + distance * eye
        server.initial_camera.look_at = middle
        server.initial_camera.fov = np.radians(42.0)

    def draw(self, scene: Scene) -> None:
        """Update the page."""
        changed, scene.changed = scene.changed, set()
        if "hand" in changed:
            self._hand(scene)
        if changed & {"object", "grasps"}:
            self._object(scene)
            self._grasps(scene)
        if changed & {"plan", "grasps"}:
            self._plan(scene)

    def _replace(self, group: str, nodes: list[Any]) -> None:
        """Set the nodes of a group; nodes of the same name have already replaced the old ones."""
        names = {node.name for node in nodes}
        for node in self._nodes.get(group, []):
            if node.name not in names:
                node.remove()
        self._nodes[group] = nodes

    # --- the hand ----------------------------------------------------------------------------------------------

    def _hand(self, scene: Scene) -> None:
        if scene.world_T_palm is None:
            return
        nodes: list[Any] = [self._palm(scene.world_T_palm)]
        for finger, pose in scene.world_T_distal.items():
            tip_m = np.asarray(pose.transformFrom(TIP_CENTRE_m))
            nodes.append(self._tip(finger, tip_m, scene.loads_N.get(finger, 0.0)))
        lines_m = bones(scene.world_T_palm, scene.world_T_distal)
        if len(lines_m):
            nodes.append(self._scene.add_line_segments("/hand/bones", lines_m, _BONE, thickness=0.006))
        self._replace("hand", nodes)

    def _palm(self, pose: Pose3) -> Any:
        return self._scene.add_box(
            "/hand/palm",
            color=_BONE,
            dimensions=_PALM_m,
            opacity=0.35,
            wxyz=quaternion(pose),
            position=pose.transformFrom(_PALM_CENTRE_m),
        )

    def _tip(self, finger: str, centre_m: Array, load_N: float | None) -> Any:
        colour = _SILENT if load_N is None else _TOUCHING if load_N > 0.1 else _IDLE
        return self._scene.add_icosphere(
            f"/hand/{finger}", radius=TIP_RADIUS_m, color=colour, subdivisions=2, position=centre_m, cast_shadow=False
        )

    # --- the object --------------------------------------------------------------------------------------------

    def _object(self, scene: Scene) -> None:
        pose = scene.world_T_object
        if pose is None:
            self._replace("object", [])
            return
        nodes: list[Any] = [
            self._scene.add_frame(
                "/object",
                axes_length=0.03,
                axes_radius=0.001,
                wxyz=quaternion(pose),
                position=pose.translation(),
            )
        ]
        if scene.surface is not None and len(scene.surface.vertices_m):
            nodes += [self._patch(number, patch) for number, patch in enumerate(patches(scene.surface))]
        if scene.covariance is not None:
            outline_m = np.column_stack([ellipse(scene.covariance), np.full(48, 0.002)])
            centre_m = pose.translation() * [1.0, 1.0, 0.0]
            nodes.append(self._line("/uncertainty", outline_m + centre_m, _POSE, 0.0015))
        self._replace("object", nodes)

    def _patch(self, number: int, patch: Patch) -> Any:
        return self._scene.add_mesh_simple(
            f"/object/surface/{number}",
            patch.vertices_m,
            patch.faces,
            color=patch.colour,
            side="double",
            opacity=0.85,
            flat_shading=True,
            cast_shadow=False,
        )

    def _grasps(self, scene: Scene) -> None:
        """All contacts in the object frame, the newest ones with their forces."""
        nodes: list[Any] = []
        placed = [grasp.points_object_m for grasp in scene.grasps if grasp.fingers]
        known = [points_m for points_m in placed if points_m is not None]
        if known and scene.world_T_object is not None:
            world_m = np.array([scene.world_T_object.transformFrom(point) for point in np.vstack(known)])
            ages = np.concatenate([np.full(len(points_m), len(known) - n - 1) for n, points_m in enumerate(known)])
            nodes.append(
                self._scene.add_point_cloud(
                    "/contacts", world_m, fading(ages), point_size=0.0035, point_shape="circle", precision="float32"
                )
            )
            nodes += self._forces(scene)
        self._replace("grasps", nodes)

    def _forces(self, scene: Scene) -> list[Any]:
        newest = scene.grasps[-1]
        if not len(newest.fingers):
            return []
        ends_m = newest.points_world_m + _FORCE_SCALE_m_N * newest.forces_N[:, None] * newest.normals_world
        arrows = np.stack([ends_m, newest.points_world_m], axis=1)
        return [
            self._scene.add_arrows(
                "/forces", arrows, _CONTACT, shaft_radius=0.0009, head_radius=0.0024, head_length=0.006
            )
        ]

    # --- the next grasp ----------------------------------------------------------------------------------------

    def _plan(self, scene: Scene) -> None:
        plan = scene.next_plan
        if plan.get("closing") not in CLOSINGS:
            self._replace("plan", [])
            return
        form = shown_form(scene.world_T_palm, scene.world_T_distal)
        table = closing(plan["closing"], float(plan["height_m"]), HandShape(form=form))
        c, s = np.cos(plan["yaw_rad"]), np.sin(plan["yaw_rad"])
        turn, place = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([plan["x_m"], plan["y_m"], 0.0])
        ways = []
        for finger in table.fingers:
            path = table.path(finger)
            ends = np.array([path.centre_m(path.valid[1]), path.centre_m(path.valid[0])])
            ways.append((ends @ turn.T + place)[::-1])
        points_m = np.array(ways)
        label = f"next: {plan['closing']}"
        self._replace(
            "plan",
            [
                self._scene.add_arrows(
                    "/next", points_m, _NEXT, shaft_radius=0.0008, head_radius=0.0025, head_length=0.007
                ),
                self._scene.add_label("/next/name", label, position=points_m[:, 0].mean(axis=0) + 0.05 * _UP),
            ],
        )

    def _line(self, name: str, points_m: Array, colour: tuple[int, int, int], thickness_m: float) -> Any:
        segments = np.stack([points_m[:-1], points_m[1:]], axis=1)
        return self._scene.add_line_segments(name, segments, colour, thickness=thickness_m)


def quaternion(pose: Pose3) -> Array:
    """w, x, y, z."""
    rotation = foxglove.quaternion(pose)
    return np.array([rotation["w"], rotation["x"], rotation["y"], rotation["z"]])


def patches(surface: ToldSurface) -> list[Patch]:
    """The surface in parts of one colour each: dark where certain, yellow where uncertain.

    An outline is shown as a vertical wall from the table to twice the height of the contacts.
    """
    vertices_m, faces, sigma_m = surface.vertices_m, surface.faces, surface.sigma_m
    if surface.dimension == 2:
        vertices_m, faces, sigma_m = wall(vertices_m, surface.origin_height_m, sigma_m)
    shares = np.clip(sigma_m[faces].mean(axis=1) / SIGMA_FULL_m, 0.0, 1.0)
    steps = np.rint(shares * (COLOURS - 1)).astype(int)
    colours = viridis(np.linspace(0.0, 1.0, COLOURS))
    return [_patch_of(vertices_m, faces[steps == step], colours[step]) for step in np.unique(steps)]


def _patch_of(vertices_m: Array, faces: Any, colour: Any) -> Patch:
    """A patch with only the vertices that these faces need."""
    used, renumbered = np.unique(faces, return_inverse=True)
    red, green, blue = (int(channel) for channel in colour)
    return Patch(vertices_m[used], renumbered.reshape(-1, 3), (red, green, blue))


def fading(ages: Array) -> Any:
    """Colours (n, 3) of contacts by the number of grasps since: red, then paler."""
    share = np.clip(1.0 - ages / 8.0, 0.15, 1.0)[:, None]
    pale = np.array([225.0, 205.0, 205.0])
    return np.rint(share * np.array(_CONTACT, dtype=float) + (1.0 - share) * pale).astype(np.uint8)
