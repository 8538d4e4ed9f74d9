"""YAML and JSON that are small to look at and large to read."""

from __future__ import annotations

import pytest
import yaml

from drivers.core.reading import json_text, yaml_text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12", 12),
        ("-1_000", -1000),
        ("0x1F", 31),
        ("0b11", 3),
        ("0", 0),
        ("017", 15),
        ("1:30", "1:30"),
        ("9" * 41, "9" * 41),
        ("0x" + "f" * 33, "0x" + "f" * 33),
        ("1e-3", 0.001),
    ],
)
def test_whole_numbers_are_short_and_have_no_base_of_60(text, value):
    assert yaml_text.parse(f"a: {text}") == {"a": value}


def test_entries_are_bounded(monkeypatch):
    monkeypatch.setattr(yaml_text, "MOST_ENTRIES", 10)
    with pytest.raises(yaml.MarkedYAMLError, match="more than 10 entries"):
        yaml_text.parse("a: [1, 2, 3, 4, 5, 6, 7, 8, 9]")


def test_json_of_very_many_lists_is_refused_before_it_is_read(monkeypatch):
    monkeypatch.setattr(json_text, "MOST_CONTAINERS", 3)
    assert json_text.parse_json(b'{"a": [[]]}') == {"a": [[]]}
    with pytest.raises(ValueError, match="more than 3 lists and objects"):
        json_text.parse_json(b'{"a": [[], []')


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xf5", "not text in UTF-8"),
        (b'{"a":\n 1,}', "a mistake in line 2, column 4"),
        (b"[" * 50_000, "nested too deeply"),
        (b"9" * 5000, "a number of more than 4300 digits"),
    ],
)
def test_what_is_no_json_is_told_without_the_words_of_a_library(content, words):
    with pytest.raises(ValueError, match=f"^{words}$"):
        json_text.parse_json(content)


def test_what_is_wrong_in_yaml_is_told_also_where_no_line_is_known():
    with pytest.raises(yaml.YAMLError) as refused:
        yaml_text.parse("name: \x07")
    words = yaml_text.problem_of(refused.value)
    assert words.startswith("unacceptable character #x0007")
    assert "\n" not in words


def test_an_error_without_words_is_told_by_its_name():
    assert yaml_text.problem_of(RecursionError()) == "RecursionError"
