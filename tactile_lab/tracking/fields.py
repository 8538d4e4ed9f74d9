"""The modelled surface in the form that is quickest to ask when poses are proposed."""

from __future__ import annotations

from tactile_lab.shape.field_grid import Field, FieldGrid
from tactile_lab.shape.gpis import Gpis

GRID_MARGIN_m = 0.040
GRID_SPACING_m = 0.003


def tabulated(fitted: Gpis) -> Field:
    """In the plane a coarse grid is cheaper than the field itself; in space it is not, for so few samples."""
    if fitted.contacts_m.shape[1] == 3:
        return fitted
    return FieldGrid.around(fitted, margin_m=GRID_MARGIN_m, spacing_m=GRID_SPACING_m)
