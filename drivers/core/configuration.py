"""YAML for configuration files: safe, and without YAML 1.1's silent surprises.

Plain ``yaml.safe_load`` keeps the last of two equal keys, reads ``1e-3`` as text and ``no`` as
false. Here equal keys are an error, ``1e-3`` is a number and only true/false are booleans.
"""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

from drivers.core.errors import ConfigurationError

Model = TypeVar("Model", bound=BaseModel)

_RETRY = "Correct the file and try again"
_UNPARSED = ", unable to parse string as a number"
_SHOWN, _LONGEST_VALUE = 5, 40


class StrictModel(BaseModel):
    """Base of all configuration models: unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    renamed: ClassVar[Mapping[str, str]] = {}
    """Keys by the names they had in the version before; they are still read, with a :class:`RenamedKeyWarning`."""

    retired: ClassVar[tuple[str, ...]] = ()
    """Keys that the version before had and that have no meaning any more; they are left out, with the same warning."""

    @model_validator(mode="before")
    @classmethod
    def _accept_former_keys(cls, content: Any) -> Any:
        if not isinstance(content, Mapping) or not any(key in content for key in (*cls.renamed, *cls.retired)):
            return content
        current = dict(content)
        for key, new in cls.renamed.items():
            if key not in current:
                continue
            if new in current:
                raise ValueError(f"{key} is the former name of {new}: remove {key}")
            current[new] = current.pop(key)
            warnings.warn(RenamedKeyWarning(f"{_reading.get()}{key} is now called {new}"), stacklevel=2)
        for key in cls.retired:
            if key in current:
                del current[key]
                warnings.warn(RenamedKeyWarning(f"{_reading.get()}{key} no longer has any effect"), stacklevel=2)
        return current


class RenamedKeyWarning(UserWarning):
    """A file uses a key by the name it had in the version before, or one that has no meaning any more."""


@contextmanager
def recorded_keys() -> Iterator[None]:
    """Within the block former keys are read without a warning: nobody can correct a recording, and nobody needs to."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RenamedKeyWarning)
        yield


_reading: ContextVar[str] = ContextVar("the file being read", default="")


class _Loader(yaml.CSafeLoader):
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


_DEEPEST = 100
_MERGE = "tag:yaml.org,2002:merge"


def _mapping_without_repeats(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    keys: list[Any] = []
    for key_node, _ in node.value:
        if key_node.tag == _MERGE:
            continue
        key = loader.construct_object(key_node, deep=True)
        if key in keys:
            raise yaml.MarkedYAMLError(problem=f"key {key!r} appears twice", problem_mark=key_node.start_mark)
        keys.append(key)
    loader.flatten_mapping(node)
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_repeats)


def load(path: Path) -> Any:
    """Read one YAML document.

    Raises:
        ConfigurationError: the file is missing, unreadable or not strict YAML.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise ConfigurationError("file not found", where=str(path), hint="Check the path") from error
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read ({error.strerror})", where=str(path), hint="Check the path"
        ) from error
    return loads(content, str(path))


def loads(content: bytes, where: str) -> Any:
    """Read one YAML document that is not a file of its own.

    Raises:
        ConfigurationError: it is not strict YAML in UTF-8.
    """
    try:
        text = content.decode("utf-8")
        _check_depth(text)
        return yaml.load(text, Loader=_Loader)
    except UnicodeDecodeError as error:
        raise ConfigurationError("is not a text file", where=where, hint="Give a YAML file in UTF-8") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: a date or number out of its range
        raise ConfigurationError(f"is not valid YAML: {_yaml_problem(error)}", where=where, hint=_RETRY) from error


def _check_depth(text: str) -> None:
    """Refuse what is nested so deep that composing it would overflow the stack. The parser itself does not recurse."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            problem = f"nested deeper than {_DEEPEST} levels"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=cast(yaml.Mark, event.start_mark))


def load_model(path: Path, model: type[Model]) -> Model:
    """Read a YAML document into a pydantic model.

    Raises:
        ConfigurationError: as :func:`load`, or the content does not fit; names each key.
    """
    return validate(load(path), model, where=str(path))


def validate(content: Any, model: type[Model], *, where: str, hint: str = _RETRY) -> Model:
    """Validate plain data against a model, with errors that name the keys. Raises ConfigurationError."""
    token = _reading.set(f"{where}: ")
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(_explain(error, model), where=where, hint=hint) from error
    finally:
        _reading.reset(token)


def flatten_keys(content: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Nested keys with values as one level of names joined by dots; a list is one value, and so is an empty mapping."""
    for key, value in content.items():
        if isinstance(value, Mapping) and value:
            yield from flatten_keys(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


# --- errors in plain words -----------------------------------------------------------------------------------------


def _yaml_problem(error: Exception) -> str:
    """What a parser found, and where in the file."""
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem_mark is None:
        return " ".join(str(error).split()) or type(error).__name__
    mark = error.problem_mark
    return f"line {mark.line + 1}, column {mark.column + 1}: {error.problem}"


def _explain(error: ValidationError, model: type[BaseModel]) -> str:
    """Up to five problems of a document, each with its key; unknown keys first, as they often explain the others."""
    found = sorted(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    problems = list(dict.fromkeys(_problem(item, model) for item in found))
    more = [f"and {len(problems) - _SHOWN} more"] if len(problems) > _SHOWN else []
    return "; ".join(problems[:_SHOWN] + more)


def _problem(item: ErrorDetails, model: type[BaseModel]) -> str:
    place = ".".join(map(str, item["loc"])) or "the document"
    if item["type"] == "extra_forbidden":
        return f"{place}: unknown key{_suggestion(item['loc'], model)}"
    if item["type"] == "missing":
        return f"{place}: is missing"
    if item["type"] in {"model_type", "model_attributes_type", "dict_type"}:
        return f"{place}: must be keys with values"
    words = re.sub(r"^[A-Z]\w+ should", "must", item["msg"].removeprefix("Value error, ")).removesuffix(_UNPARSED)
    own = item["type"] == "value_error"
    if own and not item["loc"]:
        return words
    return f"{place}: {words}{'' if own and _names(words, item['input']) else _quote_value(item['input'])}"


def _names(words: str, value: Any) -> bool:
    """Whether words of our own tell the offending value already."""
    return (f"{value:g}" if isinstance(value, (int, float)) else str(value)) in words


def _quote_value(value: Any) -> str:
    """The offending value where it is short enough to help."""
    text = repr(value)
    return f", not {text}" if isinstance(value, (str, int, float)) and len(text) <= _LONGEST_VALUE else ""


def _suggestion(place: Sequence[str | int], model: type[BaseModel]) -> str:
    """The known key that an unknown one resembles."""
    known: type[BaseModel] = model
    for key in place[:-1]:
        field = known.model_fields.get(str(key))
        if field is None or not (isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)):
            return ""
        known = field.annotation
    alike = difflib.get_close_matches(str(place[-1]), known.model_fields, n=1)
    return f" (did you mean {alike[0]}?)" if alike else ""
