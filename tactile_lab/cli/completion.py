"""What a shell offers behind options and arguments: rigs, objects, policies, shape models, experiments, sessions.

Nothing is loaded before a name is completed, and no name causes an error: what cannot be listed is
not offered. File names are the shell's own affair.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import resources
from pathlib import Path

import typer
from typer import _completion_shared

_MANIFEST = "session.yaml"
_AT_FIRST_TAB = """
if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
  %(complete_func)s "$@"
fi
"""


def answer_the_first_tab() -> None:
    """Let zsh complete when it loads the installed script: Typer's only defines how, and the first Tab is lost."""
    scripts = _completion_shared._completion_scripts
    if not scripts["zsh"].endswith(_AT_FIRST_TAB):
        scripts["zsh"] += _AT_FIRST_TAB


def complete_rig(incomplete: str) -> list[str]:
    """Rigs that come with the program."""
    folder = Path(str(resources.files("tactile_lab.rigs")))
    return _beginning(incomplete, (path.stem for path in folder.glob("*.yaml")))


def complete_object(incomplete: str) -> list[str]:
    """The catalogue of the simulated rig."""
    from drivers.simulation.objects import CATALOGUE

    return _beginning(incomplete, CATALOGUE)


def complete_method(incomplete: str) -> list[str]:
    """Estimation methods."""
    from tactile_lab.slam.tracking.trackers import METHODS

    return _beginning(incomplete, METHODS)


def complete_policy(incomplete: str) -> list[str]:
    """Exploration policies, those of extensions named in the environment too."""
    from tactile_lab.slam.exploration.policies import POLICIES

    return _beginning(incomplete, POLICIES)


def complete_shape(incomplete: str) -> list[str]:
    """Shape models."""
    from tactile_lab.slam.shape.selection.models import SHAPE_MODELS

    return _beginning(incomplete, ["auto", *SHAPE_MODELS])


def complete_experiment(incomplete: str) -> list[str]:
    """Experiments."""
    from tactile_lab.experiments.catalogue import EXPERIMENTS

    return _beginning(incomplete, ["age", "commands", "list", "pages", *EXPERIMENTS])


def complete_session(ctx: typer.Context, incomplete: str) -> list[str]:
    """Sessions under ``--root``, and ``last``."""
    root = Path(ctx.params.get("root") or "runs")
    try:
        found = [path.parent.name for path in root.glob(f"*/{_MANIFEST}")]
    except OSError:
        found = []
    return _beginning(incomplete, ["last", *found])


def _beginning(text: str, names: Iterable[str]) -> list[str]:
    return sorted(name for name in names if name.startswith(text))
