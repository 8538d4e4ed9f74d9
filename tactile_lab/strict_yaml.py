"""YAML for configuration files: safe, and without YAML 1.1's silent surprises.

Plain ``yaml.safe_load`` keeps the last of two equal keys, reads ``1e-3`` as text and ``no`` as
false. Here equal keys are an error, ``1e-3`` is a number and only true/false are booleans.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from tactile_lab.errors import ConfigurationError

Model = TypeVar("Model", bound=BaseModel)


class StrictModel(BaseModel):
    """Base of all configuration models: unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Loader(yaml.SafeLoader):
    """Safe loader with its own implicit resolvers (the parent's table is shared: copy it)."""


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith((":bool", ":float", ":timestamp"))]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile(r"^(?:true|false)$"), list("tf"))
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"^[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+|[0-9]+(?=[eE]))(?:[eE][-+]?[0-9]+)?$|^[-+]?\.(?:inf|Inf)$|^\.(?:nan|NaN)$"
    ),
    list("-+0123456789."),
)


def _mapping_without_repeats(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    keys = [loader.construct_object(key, deep=True) for key, _ in node.value]
    for index, key in enumerate(keys):
        if key in keys[:index]:
            raise yaml.MarkedYAMLError(
                problem=f"key {key!r} appears twice", problem_mark=node.value[index][0].start_mark
            )
    loader.flatten_mapping(node)
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_repeats)


def load(path: Path) -> Any:
    """Read one YAML document.

    Raises:
        ConfigurationError: the file is missing, unreadable or not strict YAML.
    """
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_Loader)
    except FileNotFoundError as error:
        raise ConfigurationError("file not found", where=str(path), hint="Check the path") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"cannot be read ({error})", where=str(path)) from error
    except yaml.YAMLError as error:
        raise ConfigurationError(f"is not valid YAML: {' '.join(str(error).split())}", where=str(path)) from error


def load_model(path: Path, model: type[Model]) -> Model:
    """Read a YAML document into a pydantic model.

    Raises:
        ConfigurationError: as :func:`load`, or the content does not fit; names each key.
    """
    return validate(load(path), model, where=str(path))


def validate(content: Any, model: type[Model], *, where: str) -> Model:
    """Validate plain data against a model, with errors that name the keys."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(_explain(error), where=where, hint="Correct the file and try again") from error


def _explain(error: ValidationError) -> str:
    problems = [f"{'.'.join(map(str, item['loc'])) or 'document'}: {item['msg']}" for item in error.errors()]
    return "; ".join(problems)
