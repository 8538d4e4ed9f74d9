"""Configuration files: YAML read into models, errors in plain words (see :mod:`drivers.core.reading.yaml_text`)."""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import LARGEST_YAML_bytes, read_bounded
from drivers.core.reading.yaml_text import parse, problem_of

Model = TypeVar("Model", bound=BaseModel)

_RETRY = "Correct the file and try again"
_UNPARSED = ", unable to parse string as an? (number|integer)$"
_SHOWN, _LONGEST_VALUE = 5, 40


class StrictModel(BaseModel):
    """Base of all configuration models: unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    renamed: ClassVar[Mapping[str, str]] = {}
    """Keys by the names they had in the version before; they are still read, with a :class:`RenamedKeyWarning`."""

    retired: ClassVar[Mapping[str, str]] = {}
    """Keys of the version before without a meaning now, with what took their place; left out with such a warning."""

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
        for key, instead in cls.retired.items():
            if key in current:
                del current[key]
                words = f"{_reading.get()}{key} no longer has any effect: {instead}"
                warnings.warn(RenamedKeyWarning(words), stacklevel=2)
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


def load(path: Path) -> Any:
    """Read one YAML document.

    Raises:
        ConfigurationError: the file is missing, unreadable, too large or not strict YAML.
    """
    try:
        content = read_bounded(path, LARGEST_YAML_bytes)
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
        return parse(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise ConfigurationError("is not a text file", where=where, hint="Give a YAML file in UTF-8") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: a date or number out of its range
        raise ConfigurationError(f"is not valid YAML: {problem_of(error)}", where=where, hint=_RETRY) from error


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


def _explain(error: ValidationError, model: type[BaseModel]) -> str:
    """Up to five problems of a document, each with its key; unknown keys first, as they often explain the others."""
    found = sorted(error.errors(include_url=False), key=lambda item: item["type"] != "extra_forbidden")
    different = list({(item["loc"], item["type"], item["msg"]): item for item in found}.values())
    more = [f"and {len(different) - _SHOWN} more"] if len(different) > _SHOWN else []
    problems = [_problem(item, model) for item in different[:_SHOWN]]  # a file may have 100 000, each slow to explain
    return "; ".join([*dict.fromkeys(problems), *more])


def _problem(item: ErrorDetails, model: type[BaseModel]) -> str:
    place = ".".join(map(str, item["loc"])) or "the document"
    if item["type"] == "extra_forbidden":
        return f"{place}: unknown key{_suggestion(item['loc'], model)}"
    if item["type"] == "missing":
        return f"{place}: is missing"
    if item["type"] in {"model_type", "model_attributes_type", "dict_type"}:
        return f"{place}: must be keys with values"
    words = plain_words(item["msg"])
    own = item["type"] == "value_error"
    if own and not item["loc"]:
        return words
    return f"{place}: {words}{'' if own and _names(words, item['input']) else _quote_value(item['input'])}"


def plain_words(message: str) -> str:
    """What pydantic says about a value, without its own phrases ("Value error, ...", "Input should ...")."""
    own = message.removeprefix("Value error, ").removeprefix("Assertion failed, ")
    return re.sub(_UNPARSED, "", re.sub(r"^[A-Z]\w+ should", "must", own))


def _names(words: str, value: Any) -> bool:
    """Whether our own message quotes the offending value already."""
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
