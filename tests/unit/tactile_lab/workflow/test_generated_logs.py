"""The whole of ``reconstruct`` on generated logs: a result, or an error in words, and nothing else."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.core.errors import TactileLabError
from tactile_lab.workflow.reconstructing import Wishes, reconstruct_log
from tests.support.generated_logs import damaged_logs, logs

METHODS = ("joint", "particle", "thesis-pf", "thesis-pf-graph", "odometry", "icp", "known-pose")
QUICK = "particles: 100\ncontour_resolution_m: 0.004\nmesh_resolution_m: 0.012\n"


@settings(max_examples=8, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(document=logs(), method=st.sampled_from(METHODS), gate=st.sampled_from(["", "gate: {least_contacts: 0}\n"]))
def test_any_log_that_fits_the_form_ends_in_a_result_or_in_words(document, method, gate):
    _reconstruct(document, method, gate)


@settings(max_examples=14, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(document=damaged_logs(), method=st.sampled_from(METHODS))
def test_a_log_that_is_damaged_anywhere_ends_in_a_result_or_in_words(document, method):
    _reconstruct(document, method, "")


def _reconstruct(document: Any, method: str, gate: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        log, chosen = Path(folder, "log.json"), Path(folder, "settings.yaml")
        log.write_text(json.dumps(document))
        chosen.write_text(QUICK + gate)
        try:
            finished = reconstruct_log(log, Wishes(method, settings=chosen), Path(folder, "out"))
        except TactileLabError:
            return
        assert finished.problem or finished.evaluation is not None
