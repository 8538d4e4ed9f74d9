from __future__ import annotations

import json
import math
from contextlib import suppress

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field, field_validator, model_validator

from drivers.core.configuration import StrictModel, flatten_keys, load, load_model, loads, validate
from drivers.core.errors import ConfigurationError


class Inner(StrictModel):
    limit_N: float = 1.0


class Settings(StrictModel):
    cycle_s: float = Field(gt=0.0)
    grasps: int = 16
    inner: Inner = Inner()
    named: dict[str, Inner] = Field(default_factory=dict)


def read(tmp_path, text: str):
    path = tmp_path / "file.yaml"
    path.write_text(text, encoding="utf-8")
    return load(path)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("-2.5E+2", -250.0),
        (".5", 0.5),
        ("3.", 3.0),
        ("7", 7),
        ("true", True),
        ("no", "no"),
        ("on", "on"),
        ("2026-01-01", "2026-01-01"),
        ("1.2.3", "1.2.3"),
        ("'1e-3'", "1e-3"),
        ("e5", "e5"),
    ],
)
def test_a_value_means_what_it_looks_like(tmp_path, text, value):
    found = read(tmp_path, f"key: {text}\n")["key"]
    assert found == value
    assert type(found) is type(value)


def test_infinity_and_nan_are_read_as_numbers_so_that_models_can_refuse_them(tmp_path):
    assert read(tmp_path, "a: -.inf")["a"] == -math.inf
    assert math.isnan(read(tmp_path, "a: .nan")["a"])


@pytest.mark.parametrize("text", ["a: 1\na: 2\n", "x:\n  b: 1\n  b: 1\n", "- {a: 1, a: 1}\n"])
def test_equal_keys_are_refused_with_their_line(tmp_path, text):
    with pytest.raises(ConfigurationError, match=r"line \d+, column \d+: key '[ab]' appears twice"):
        read(tmp_path, text)


def test_anchors_and_merges_work(tmp_path):
    text = "base: &base {a: 1, b: 2}\nmore:\n  <<: *base\n  b: 3\nsame: *base\n"
    assert read(tmp_path, text) == {"base": {"a": 1, "b": 2}, "more": {"a": 1, "b": 3}, "same": {"a": 1, "b": 2}}


@pytest.mark.parametrize("text", ["!!python/object/apply:os.getcwd []", "a: [1", "a: b: c", "\t- x", "a: *unknown"])
def test_what_is_not_safe_yaml_is_refused_by_name(tmp_path, text):
    with pytest.raises(ConfigurationError, match=r"file\.yaml: is not valid YAML") as caught:
        read(tmp_path, text)
    assert "unicode string" not in str(caught.value)


def test_the_loader_of_the_yaml_package_stays_as_it_was():
    assert yaml.safe_load("a: no") == {"a": False}


def test_files_that_can_not_be_read(tmp_path):
    with pytest.raises(ConfigurationError, match=r"none\.yaml: file not found"):
        load(tmp_path / "none.yaml")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigurationError, match="is not a text file"):
        load(tmp_path / "binary.yaml")


texts = st.text('abyn<é0.-:# \n"', max_size=6)
numbers = st.integers(-(10**9), 10**9) | st.floats(allow_nan=False, allow_infinity=False)
plain_values = st.recursive(
    st.booleans() | numbers | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=8,
)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(content=st.dictionaries(st.sampled_from("abc"), plain_values, max_size=3))
def test_json_documents_are_read_unchanged(tmp_path_factory, content):
    """JSON is YAML, and says of every value what it is."""
    path = tmp_path_factory.mktemp("yaml") / "file.yaml"
    path.write_text(json.dumps(content, ensure_ascii=False), encoding="utf-8")
    assert load(path) == content


@settings(max_examples=60, derandomize=True, deadline=None)
@given(content=st.binary(max_size=60))
def test_any_bytes_give_a_document_or_our_error(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("yaml") / "file.yaml"
    path.write_bytes(content)
    with suppress(ConfigurationError):
        load(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"cycle_s": 1.0, "colour": "red"}, "colour: unknown key"),
        ({"cycle_s": 1.0, "grasp": 3}, "grasp: unknown key (did you mean grasps?)"),
        ({"cycle_s": 1.0, "inner": {"limit": 3}}, "inner.limit: unknown key (did you mean limit_N?)"),
        ({"cycle_s": 1.0, "named": {"FF": {"limit": 3}}}, "named.FF.limit: unknown key"),
        ({}, "cycle_s: is missing"),
        ({"cycle_s": math.nan}, "cycle_s: must be a finite number, not nan"),
        ({"cycle_s": math.inf}, "cycle_s: must be a finite number, not inf"),
        ({"cycle_s": "fast"}, "cycle_s: must be a valid number, not 'fast'"),
        ({"cycle_s": 0.0}, "cycle_s: must be greater than 0, not 0.0"),
        ({"cycle_s": 1.0, "inner": 3}, "inner: must be keys with values"),
        (None, "the document: must be keys with values"),
        ([1], "the document: must be keys with values"),
    ],
)
def test_a_document_that_does_not_fit_is_explained_by_its_keys(content, words):
    with pytest.raises(ConfigurationError) as caught:
        validate(content, Settings, where="mine.yaml")
    assert str(caught.value).startswith(f"mine.yaml: {words}")
    assert caught.value.exit_code == 2


class Span(StrictModel):
    low: float = 0.0
    unit: str = "m"

    @model_validator(mode="after")
    def _positive(self) -> Span:
        if self.low < 0:
            raise ValueError("low and high are one way round")
        return self

    @field_validator("unit")
    @classmethod
    def _known(cls, unit: str) -> str:
        if unit != "m":
            raise ValueError(f"{unit!r} is no unit" if unit == "inch" else "must be m")
        return unit


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"low": -1.0}, "low and high are one way round. C"),
        ({"unit": "inch"}, "unit: 'inch' is no unit. C"),
        ({"unit": "feet"}, "unit: must be m, not 'feet'. C"),
    ],
)
def test_words_of_a_model_s_own_stand_without_what_they_say_already(content, words):
    with pytest.raises(ConfigurationError) as caught:
        validate(content, Span, where="mine.yaml")
    assert str(caught.value).startswith(f"mine.yaml: {words}")


def test_all_problems_are_told_at_once_but_not_without_end():
    with pytest.raises(ConfigurationError, match=r"a: unknown key.*b: unknown key.*; and 4 more\."):
        validate({"cycle_s": 1.0, **dict.fromkeys("abcdefghi")}, Settings, where="mine.yaml")


def test_long_values_are_not_repeated():
    with pytest.raises(ConfigurationError) as caught:
        validate({"cycle_s": "x" * 500}, Settings, where="mine.yaml")
    assert "xxx" not in str(caught.value)


def test_a_model_is_read_from_a_file_and_can_not_be_changed(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text("cycle_s: 1e-2\ninner: {limit_N: 2}\n")
    settings_read = load_model(path, Settings)
    assert settings_read == Settings(cycle_s=0.01, inner=Inner(limit_N=2.0))
    with pytest.raises(ValueError, match="frozen"):
        settings_read.grasps = 3


@pytest.mark.parametrize(
    "content", [b"[" * 100_000, b"[" * 100_000 + b"]" * 100_000, b"- " * 100_000, b"{a: " * 100_000]
)
def test_a_document_nested_without_end_is_refused(content: bytes) -> None:
    with pytest.raises(ConfigurationError, match="nested deeper than 100 levels"):
        loads(content, "rig.yaml")


def test_nested_keys_become_dotted_names_and_an_empty_mapping_is_a_value() -> None:
    content = {"a": 1, "b": {"c": [1, 2], "d": {}, "e": {"f": None}}}
    assert list(flatten_keys(content)) == [("a", 1), ("b.c", [1, 2]), ("b.d", {}), ("b.e.f", None)]


ALIASES = "a0: &a0 [1, 2]\n" + "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (ALIASES, "more than 200000 entries, aliases expanded"),
        ("a: &a [*a]", "an alias inside of what it names"),
        ("? [1, 2]\n: 3", "a key must be one word"),
    ],
)
def test_what_grows_without_end_is_refused_before_anything_is_made_of_it(tmp_path, text, told):
    (tmp_path / "rig.yaml").write_text(text)
    with pytest.raises(ConfigurationError, match=told):
        load(tmp_path / "rig.yaml")


def test_aliases_that_stay_small_are_read(tmp_path):
    (tmp_path / "rig.yaml").write_text("a: &one {x: 1}\nb: *one\nc: {<<: *one, y: 2}\n")
    assert load(tmp_path / "rig.yaml") == {"a": {"x": 1}, "b": {"x": 1}, "c": {"x": 1, "y": 2}}


def test_a_file_of_more_than_a_megabyte_is_not_even_parsed(tmp_path):
    (tmp_path / "rig.yaml").write_bytes(b"a: 1\n" * 300_000)
    with pytest.raises(ConfigurationError, match=r"is too large: 1,5\d\d,\d\d\d bytes, and at most 1,000,000 "):
        load(tmp_path / "rig.yaml")


def test_of_very_many_problems_only_those_shown_are_explained(monkeypatch):
    explained: list[str] = []

    def explain(place, model):
        explained.append(str(place[-1]))
        return ""

    monkeypatch.setattr("drivers.core.configuration._suggestion", explain)
    with pytest.raises(ConfigurationError, match=r"k0: unknown key; .*; and 9995 more"):
        validate({f"k{number}": number for number in range(10_000)}, StrictModel, where="many.yaml")
    assert explained == ["k0", "k1", "k2", "k3", "k4"]
