"""The back end of the tracker: finds loops in the map and corrects all poses if that improves them."""

from __future__ import annotations

from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.errors import ShapeError
from tactile_lab.slam.graph.faces import FaceSettings, Labels, assign_to_segments, contour_segments, surface_faces
from tactile_lab.slam.graph.loop_tests import LoopTestSettings, test_together
from tactile_lab.slam.graph.pose_graph import (
    Loop,
    LoopReport,
    PoseGraphSettings,
    explains_better,
    find_loops,
    optimise_poses,
)
from tactile_lab.slam.shape.surfaces.surface import extract_contour
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise


class BackEndSettings(StrictModel):
    """Parameters of the back end.

    Attributes:
        enabled: if not, the filter's poses are kept.
        faces: segmentation of the object.
        graph: loops and optimisation.
        contour_resolution_m: of the contour that is divided into faces (2-D).
        tests: further tests of loops beyond those on their own pairs; not used by the thesis's variant.
    """

    enabled: bool = True
    faces: FaceSettings = FaceSettings()
    graph: PoseGraphSettings = PoseGraphSettings()
    contour_resolution_m: float = Field(default=0.003, gt=0)
    tests: LoopTestSettings = LoopTestSettings()


class BackEnd:
    """Loops found so far and their verdicts."""

    def __init__(
        self,
        settings: BackEndSettings,
        *,
        as_printed: bool = False,
        noise: MotionNoise | None = None,
    ) -> None:
        """
        Args:
            settings: see there.
            as_printed: the thesis's variant: loops are tested one by one against the filter's poses only.
            noise: of the object's motion in the hand; the thesis's 100 % if not given.
        """
        self._settings, self._as_printed = settings, as_printed
        self._noise = noise or MotionNoise()
        self._loops: list[Loop] = []

    @property
    def reports(self) -> tuple[LoopReport, ...]:
        """Every loop tested, in order of its grasps."""
        return tuple(loop.report for loop in self._loops)

    def close_loops(self, contact_map: ContactMap) -> ContactMap:
        """Look for loops of the latest grasp; the corrected map if one was found and it explains the contacts."""
        latest = len(contact_map.placed) - 1
        if not self._settings.enabled or not contact_map.placed[latest].used:
            return contact_map
        found = find_loops(contact_map, self._faces(contact_map), self._settings.graph, [latest])
        self._loops += found
        return self._correct(contact_map) if any(loop.report.accepted for loop in found) else contact_map

    def close_all_loops(self, contact_map: ContactMap) -> ContactMap:
        """Compare all grasps again on the final map, whose faces are known best."""
        if not self._settings.enabled or len(contact_map.placed) < 3:
            return contact_map
        grasps = list(range(2, len(contact_map.placed)))
        self._loops = find_loops(contact_map, self._faces(contact_map), self._settings.graph, grasps)
        if not self._as_printed:
            self._loops = test_together(contact_map, self._loops, self._noise, self._settings.tests)
        return self._correct(contact_map)

    def _correct(self, contact_map: ContactMap) -> ContactMap:
        corrected = optimise_poses(contact_map, self._loops, self._settings.graph)
        return corrected if explains_better(corrected, contact_map) else contact_map

    def _faces(self, contact_map: ContactMap) -> Labels:
        contacts = contact_map.contacts
        if contacts.dimension == 3:
            return surface_faces(contacts, self._settings.faces)
        try:
            contour = extract_contour(contact_map.fit(), resolution_m=self._settings.contour_resolution_m)
        except ShapeError:  # too little is known for a contour: the contacts alone have to tell
            return surface_faces(contacts, self._settings.faces)
        segments = contour_segments(contour.points_m, self._settings.faces)
        return assign_to_segments(contacts, segments, self._settings.faces)
