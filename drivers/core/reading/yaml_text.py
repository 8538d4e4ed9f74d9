"""YAML text, strict and bounded: safe, without YAML 1.1's silent surprises, and never larger than it looks.

Plain ``yaml.safe_load`` keeps the last of two equal keys, reads ``1e-3`` as text and ``no`` as false. Here equal keys
are an error, ``1e-3`` is a number and only true/false are booleans. Nesting is bounded, and so is what aliases expand
to: ten lines of aliases of aliases stand for more entries than any memory holds.
"""

from __future__ import annotations

import re
from typing import Any, NoReturn, cast

import yaml

DEEPEST = 100
"""The parser does not recurse, but what makes mappings and lists of it does."""
MOST_ENTRIES = 200_000
"""A megabyte of measured figures has a third of it."""


class _Loader(yaml.CSafeLoader):
    """Safe loader with its own implicit resolvers (the parent's table is shared: copy it)."""


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith((":bool", ":int", ":float", ":timestamp"))]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile(r"^(?:true|false)$"), list("tf"))
_Loader.add_implicit_resolver(  # of some length, and none to the base of 60, which takes the time of its length squared
    "tag:yaml.org,2002:int",
    re.compile(r"^[-+]?(?:0|[1-9][0-9_]{0,39}|0[0-7_]{1,39}|0b[0-1_]{1,128}|0x[0-9a-fA-F_]{1,32})$"),
    list("-+0123456789"),
)
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"^[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+|[0-9]+(?=[eE]))(?:[eE][-+]?[0-9]+)?$|^[-+]?\.(?:inf|Inf)$|^\.(?:nan|NaN)$"
    ),
    list("-+0123456789."),
)

_MERGE = "tag:yaml.org,2002:merge"


def _mapping_without_repeats(loader: Any, node: yaml.MappingNode) -> dict[Any, Any]:
    keys: set[Any] = set()
    for key_node, _ in node.value:
        if key_node.tag == _MERGE:
            continue
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str | int | float | bool | None):
            raise yaml.MarkedYAMLError(problem="a key must be one word", problem_mark=key_node.start_mark)
        if key in keys:
            raise yaml.MarkedYAMLError(problem=f"key {key!r} appears twice", problem_mark=key_node.start_mark)
        keys.add(key)
    loader.flatten_mapping(node)
    mapping: dict[Any, Any] = loader.construct_mapping(node, deep=True)
    return mapping


_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_repeats)


def parse(text: str) -> Any:
    """The one document in a text.

    Raises:
        yaml.YAMLError: it is not strict YAML, nested too deeply, or expands to too much.
        ValueError: a date or number is out of its range.
    """
    _check_bounds(text)
    return yaml.load(text, Loader=_Loader)


def problem_of(error: Exception) -> str:
    """What a parser found, and where in the text."""
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem_mark is None:
        return " ".join(str(error).split()) or type(error).__name__
    mark = error.problem_mark
    return f"line {mark.line + 1}, column {mark.column + 1}: {error.problem}"


def _check_bounds(text: str) -> None:
    """Walk through a text without making anything of it. Raises MarkedYAMLError."""
    sizes: dict[str, int] = {}  # entries that each anchor stands for, aliases in it expanded
    open_nodes: list[tuple[str | None, int]] = []  # anchor, and the entries counted before it began
    entries = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in (anchor for anchor, _ in open_nodes):
                _refuse(event, "an alias inside of what it names")
            entries += sizes.get(event.anchor or "", 1)
        elif isinstance(event, yaml.CollectionStartEvent):
            open_nodes.append((event.anchor, entries))
            entries += 1
            if len(open_nodes) > DEEPEST:
                _refuse(event, f"nested deeper than {DEEPEST} levels")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_nodes.pop()
            if anchor is not None:
                sizes[anchor] = entries - before
        elif isinstance(event, yaml.ScalarEvent):
            entries += 1
        if entries > MOST_ENTRIES:
            _refuse(event, f"more than {MOST_ENTRIES} entries, aliases expanded")


def _refuse(event: yaml.Event, problem: str) -> NoReturn:
    raise yaml.MarkedYAMLError(problem=problem, problem_mark=cast(yaml.Mark, event.start_mark))
