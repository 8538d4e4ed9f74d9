"""Keys of the files that people write: a name, default or bound that changes makes their files mean something else.

The stored list holds every key of every configuration model as JSON schema says it. A change of it that is meant goes
into the changelog too; a key that is renamed is read by its former name for one version.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

from drivers.core.configuration import StrictModel
from tests.support.baseline import assert_baseline
from tests.support.repository import REPOSITORY

PACKAGES = ("drivers", "calibration", "sessions", "tactile_lab")
OF_MODELS = ("StrictModel", "Settings)")
FOR_PEOPLE = ("title", "description", "$defs")


def test_keys_defaults_and_bounds_are_those_that_files_were_written_for() -> None:
    for package in PACKAGES:
        keys = {name: key for model in models(package) for name, key in keys_of(model)}
        assert len(keys) > 50
        assert_baseline(f"file_keys/{package}", keys)


def models(package: str) -> Iterator[type[StrictModel]]:
    """All configuration models that a package defines."""
    for file in sorted((REPOSITORY / package).rglob("*.py")):
        if not any(word in file.read_text(encoding="utf-8") for word in OF_MODELS):
            continue
        module = importlib.import_module(".".join(file.relative_to(REPOSITORY).with_suffix("").parts))
        for value in vars(module).values():
            if isinstance(value, type) and issubclass(value, StrictModel) and value.__module__ == module.__name__:
                yield value


def keys_of(model: type[StrictModel]) -> Iterator[tuple[str, Any]]:
    """The name and the schema of each key of a model, and the names by which it is still read."""
    for key, schema in model.model_json_schema().get("properties", {}).items():
        yield f"{model.__module__}.{model.__qualname__}.{key}", without_words(schema)
    for former, key in model.renamed.items():
        yield f"{model.__module__}.{model.__qualname__}.{former}", f"now {key}"
    for former in model.retired:
        yield f"{model.__module__}.{model.__qualname__}.{former}", "no longer has any effect"


def without_words(schema: Any) -> Any:
    """A schema without what is only there to be read."""
    if isinstance(schema, list):
        return [without_words(item) for item in schema]
    if isinstance(schema, dict):
        return {key: without_words(item) for key, item in schema.items() if key not in FOR_PEOPLE}
    return schema
