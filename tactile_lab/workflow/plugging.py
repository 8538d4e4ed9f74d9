"""Plug-ins of installed packages: what there is, what is wrong with it, and which of them a session uses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from drivers.core.errors import ConfigurationError
from drivers.core.installed.plugins import Plugin, installed_plugins
from drivers.core.registry import Registry
from drivers.fingertips.kinds import FINGERTIPS, WIRES
from drivers.positioner.kinds import POSITIONERS
from drivers.simulation.fingertips import SIMULATED_FINGERTIPS
from drivers.simulation.positioners import SIMULATED_POSITIONERS
from sessions.recording.device_stamps import STAMPERS
from sessions.recording.session import Session
from tactile_lab.evaluation.figures import FIGURES
from tactile_lab.rigs.description import RigDescription
from tactile_lab.rigs.emulate import EMULATORS
from tactile_lab.slam.exploration.policies import POLICIES
from tactile_lab.slam.shape.selection.models import SHAPE_MODELS
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tracking.trackers import METHODS
from tactile_lab.workflow.exporters import EXPORTERS

REGISTRIES: Mapping[str, Registry[Any]] = {
    registry.group: registry
    for registry in (
        POLICIES, SHAPE_MODELS, METHODS, FIGURES, EXPORTERS, FINGERTIPS, WIRES, POSITIONERS,
        SIMULATED_FINGERTIPS, SIMULATED_POSITIONERS, EMULATORS, STAMPERS,
    )
}  # fmt: skip
"""Every kind that packages can add to, by the end of its group's name."""

RECORD = "plugins"
"""Key of a session's settings: the plug-ins that it used."""


@dataclass(frozen=True)
class PluginUse:
    """A plug-in as the record of a session names it.

    Attributes:
        kind: in words: "policy".
        name: of the entry.
        package, version: of the distribution.
        file: of its module.
    """

    kind: str
    name: str
    package: str
    version: str
    file: str


def check_plugins() -> tuple[tuple[Plugin, str], ...]:
    """All installed plug-ins, each imported, with what is wrong with it; "" where it can be used."""
    return tuple((plugin, _problem(plugin)) for plugin in installed_plugins())


def refused_plugins() -> tuple[str, ...]:
    """A sentence for each installed plug-in that is not used, without importing any."""
    return tuple(
        f"the plug-in {plugin.name!r} of {plugin.origin} is not used: it {problem}"
        for plugin, problem in Registry.plugin_problems().items()
    )


def used_plugins(rig: RigDescription, slam: SlamSettings, policy: str | None) -> list[dict[str, str]]:
    """The plug-ins behind the names that a session's rig and settings choose, as plain data for its record."""
    found = []
    for registry, name in _chosen(rig, slam, policy):
        if (plugin := registry.plugin(name)) is not None:
            use = PluginUse(registry.kind, name, plugin.package, plugin.version, registry.file(name))
            found.append(asdict(use))
    return found


def changed_plugins(session: Session) -> Iterator[str]:
    """What differs between the plug-ins that a session used and those that are installed, in words."""
    now = {plugin.package: plugin.version for plugin in installed_plugins()}
    then = {use["package"]: use["version"] for use in session.manifest.settings.get(RECORD, ())}
    for package, version in then.items():
        if now.get(package) != version:
            yield f"{package} {version} then, {now.get(package, 'not installed')} now"


def _chosen(rig: RigDescription, slam: SlamSettings, policy: str | None) -> Iterator[tuple[Registry[Any], str]]:
    wires = rig.wires.fingertips.values() if rig.wires else ()
    yield FINGERTIPS, rig.fingertips
    yield from ((WIRES, wire) for wire in dict.fromkeys(wiring.wire for wiring in wires))
    yield POSITIONERS, rig.positioner
    if rig.kind == "simulated" or rig.emulated:
        yield SIMULATED_FINGERTIPS, rig.fingertips
        yield SIMULATED_POSITIONERS, rig.positioner
    if policy is not None:
        yield POLICIES, policy
    yield METHODS, slam.method
    yield SHAPE_MODELS, slam.shape_model


def _problem(plugin: Plugin) -> str:
    registry = REGISTRIES.get(plugin.group)
    if registry is None:
        return f"there is no kind {plugin.group!r}; kinds are {', '.join(REGISTRIES)}"
    if registry.plugin(plugin.name) is None:
        return f"its name is already used by {registry.file(plugin.name)}: choose another"
    if plugin.obstacle:
        return f"it {plugin.obstacle}"
    try:
        registry[plugin.name]
    except ConfigurationError as error:
        return error.what
    return ""
