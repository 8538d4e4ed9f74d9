from __future__ import annotations

import inspect
import pickle

import pytest

from drivers.core import errors
from drivers.core.errors import TactileLabError

ALL = [kind for _, kind in inspect.getmembers(errors, inspect.isclass)]


@pytest.mark.parametrize(
    ("where", "hint", "text"),
    [
        ("", "", "it broke"),
        ("hand", "", "hand: it broke"),
        ("", "Mend it", "it broke. Mend it"),
        ("hand", "Mend it", "hand: it broke. Mend it"),
    ],
)
def test_a_message_says_where_what_and_what_next(where, hint, text):
    assert str(TactileLabError("it broke", where=where, hint=hint)) == text


@pytest.mark.parametrize("kind", ALL)
def test_errors_cross_a_process_border_unchanged(kind):
    error = kind("it broke", where="hand", hint="Mend it")
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is kind
    assert (copy.what, copy.where, copy.hint, str(copy)) == (error.what, error.where, error.hint, str(error))


@pytest.mark.parametrize("kind", ALL)
def test_the_tree_in_the_docstring_is_the_tree(kind):
    assert kind.__name__ in (errors.__doc__ or "")
    assert issubclass(kind, TactileLabError)
    assert kind.exit_code in {1, 2, 4, 130}
