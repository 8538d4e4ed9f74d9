"""One run of the stress test of pose graphs, from a cell to its figures."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.graph_stress import StressGraph, stock_solvers, stress_graph, trajectory_errors
from tactile_lab.slam.graph.robust import solve_robustly

OUR_SOLVER = "ours"


def solve_stressed_graph(cell: Cell) -> dict[str, Any]:
    """A solver on a pose graph with wrong loops. Cell: solver, one of gtsam's or "ours"."""
    graph = stress_graph(cell.seed)
    started = time.perf_counter()
    if cell["solver"] != OUR_SOLVER:
        rows = stock_solvers()[cell["solver"]](graph)
        verdicts = {}
    else:
        solution = solve_robustly(graph.odometry, graph.loops)
        rows, verdicts = solution.rows, _verdicts(graph, solution.accepted)
    seconds = time.perf_counter() - started
    metres, radians = trajectory_errors(rows, graph.rows)
    return {"error_mm": 1e3 * metres, "error_deg": float(np.rad2deg(radians)), "ms": 1e3 * seconds, **verdicts}


def _verdicts(graph: StressGraph, accepted: Any) -> dict[str, Any]:
    return {
        "wrong_loops": int(graph.wrong.sum()),
        "wrong_accepted": int((accepted & graph.wrong).sum()),
        "right_refused": int((~accepted & ~graph.wrong).sum()),
    }
