"""HTML building blocks. Texts are escaped here; existing markup has type :class:`Markup`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


class Markup(str):
    """Text that is already HTML."""

    __slots__ = ()


def markup(content: str | Markup) -> Markup:
    """Plain text escaped; markup as it is."""
    return content if isinstance(content, Markup) else Markup(escape(content))


def element(tag: str, *content: str | Markup, **attributes: str) -> Markup:
    """One element. ``class_`` stands for ``class``; underscores in other names for hyphens."""
    names = "".join(f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"' for name, value in attributes.items())
    return Markup(f"<{tag}{names}>{join(content)}</{tag}>")


def join(parts: Iterable[str | Markup], between: str = "") -> Markup:
    """Concatenate parts."""
    return Markup(between.join(markup(part) for part in parts))


def figure(picture: str, caption: str, heading: str = "", *extra: Markup) -> Markup:
    """A picture (finished SVG) on a card with heading and caption."""
    head = [element("h3", heading)] if heading else []
    return element("figure", *head, *extra, Markup(picture), element("figcaption", caption), class_="card")


_LONG = 24
"""Letters from which on a cell of text keeps a width to be read in, and the table scrolls where the page has none."""


def table(head: Sequence[str], rows: Iterable[Sequence[str | Markup]], text_columns: Iterable[int] = (0,)) -> Markup:
    """A table whose first column names the row; ``text_columns`` are left-aligned."""
    left = set(text_columns)
    kinds = [{"class_": "text"} if index in left else {} for index in range(len(head))]
    titles = [element("th", title, scope="col", **kind) for title, kind in zip(head, kinds, strict=True)]
    body = [element("tr", element("th", row[0], scope="row"), *map(_cell, row[1:], kinds[1:])) for row in rows]
    return element(
        "div", element("table", element("thead", element("tr", *titles)), element("tbody", *body)), class_="scroll"
    )


def _cell(content: str | Markup, attributes: dict[str, str]) -> Markup:
    is_long = attributes and not isinstance(content, Markup) and len(content) > _LONG
    return element("td", content, **({"class_": "text long"} if is_long else attributes))


def badge(text: str, kind: str) -> Markup:
    """A small coloured label; ``kind`` is good, warn or bad."""
    return element("span", text, class_=f"badge {kind}")
