"""Surfaces in plots: what is seen, in which order, how dark, and that a stored plot draws the same."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tactile_lab.experiments.plot_data import Plot, SurfacePanel
from tactile_lab.experiments.plot_surfaces import shade
from tactile_lab.experiments.plots import draw
from tactile_lab.experiments.thesis.facets import between_0_and_1, edges, faces_observer, facets, in_picture


def test_only_three_sides_of_a_box_are_seen_and_all_its_edges() -> None:
    box = trimesh.creation.box((0.06, 0.04, 0.02))
    assert len(facets(box.vertices, box.faces, np.zeros(8))) == 6
    assert len(edges(box)) == 12
    assert faces_observer(np.eye(3)).tolist() == [True, False, True]


def test_a_near_facet_comes_after_a_far_one_and_has_its_own_shade() -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]])
    near = triangle + np.array([0.0, 0.0, 0.05])
    rows = facets(
        np.vstack([near, triangle]), np.array([[0, 1, 2], [3, 4, 5]]), np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2])
    )
    assert [row[6] for row in rows] == [0.2, 1.0]


def test_up_in_the_world_is_up_in_the_picture() -> None:
    (x_low, y_low), (x_high, y_high) = in_picture(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]]))
    assert x_low == x_high
    assert y_high - y_low == pytest.approx(100 * np.cos(np.deg2rad(28.0)), abs=0.1)


def test_shades_get_darker_evenly_enough_for_a_grey_print() -> None:
    def lightness(value: float) -> float:
        red, green, blue = (int(shade(value)[place : place + 2], 16) for place in (1, 3, 5))
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    steps = -np.diff([lightness(value) for value in np.linspace(0, 1, 11)])
    assert steps.min() > 10


def test_equal_values_have_the_lightest_shade() -> None:
    assert between_0_and_1(np.full(3, 7.0)).tolist() == [0.0, 0.0, 0.0]
    assert between_0_and_1(np.array([2.0, 4.0, 3.0])).tolist() == [0.0, 1.0, 0.5]


def test_a_plot_read_from_its_file_draws_the_same_picture() -> None:
    panel = SurfacePanel(
        "a cube", ((0.0, 0.0, 10.0, 0.0, 0.0, 10.0, 0.5),), ((0.0, 0.0, 10.0, 0.0),), ((3.0, 3.0),), (("1", 2.0, 2.0),)
    )
    plot = Plot((panel,), 1, "shade: something")
    again = Plot.from_json(plot.as_json())
    assert again == plot
    assert draw("title", again) == draw("title", plot)
    assert shade(0.5) in draw("title", plot)
