"""A whole session of an experiment on the simulated rig, in this process and without a recording."""

from __future__ import annotations

from sessions.conductor.conductor import Conductor
from sessions.conductor.decisions import SessionRoles
from sessions.conductor.progress import Progress
from sessions.conductor.session_outcome import SessionOutcome
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.settings import SessionSettings


def run_unrecorded(
    runtime: RigRuntime, settings: SessionSettings, roles: SessionRoles, watch: Progress
) -> SessionOutcome:
    """Connects the rig, runs the session to its end, and closes the rig in any case.

    Args:
        runtime, settings, roles: of the session.
        watch: is told everything that happens.

    Raises:
        KeyboardInterrupt: a person interrupted the session: one of an experiment's many, it is made again.
    """
    runtime.connect()
    try:
        outcome = Conductor(runtime, settings, roles, watch).run()
    finally:
        runtime.close()
    outcome.raise_if_interrupted()
    return outcome
