"""Draws docs/pictures/estimator.svg: the way from a grasp to a trajectory and a shape. Run it from the repository."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

_WIDTH, _HEIGHT, _GAP_X, _GAP_Y = 200, 58, 34, 46
_ROWS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (
        "each grasp",
        (
            ("1 contacts", "check, project, free places"),
            ("2 predict", "hand motion (3.7, 3.8)"),
            ("3 propose", "poses that fit the field"),
            ("4 branch", "place, or put aside"),
            ("5 smooth", "all poses, shape integrated out"),
            ("6 rank", "by evidence, keep four"),
        ),
    ),
    (
        "at the end",
        (
            ("7 second opinions", "backwards, spliced, deferred"),
            ("8 faces", "poses and flat faces together"),
            ("9 relocalize", "grasps driven onto the object"),
            ("10 shape and sigma", "model chosen by evidence"),
        ),
    ),
)


def drawing() -> str:
    """The picture as SVG."""
    wide = max(len(boxes) for _, boxes in _ROWS)
    width, height = wide * (_WIDTH + _GAP_X) + 20, len(_ROWS) * (_HEIGHT + _GAP_Y) + 44
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z" fill="#555"/></marker></defs>',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for row, (title, boxes) in enumerate(_ROWS):
        top = 34 + row * (_HEIGHT + _GAP_Y)
        parts.append(f'<text x="10" y="{top - 10}" font-size="13" fill="#777">{escape(title)}</text>')
        for column, box in enumerate(boxes):
            parts += _box(10 + column * (_WIDTH + _GAP_X), top, *box, first=column == 0)
    right = 10 + 5 * (_WIDTH + _GAP_X) + _WIDTH
    under = 34 + _HEIGHT
    parts.append(_line(f"M{right - 60} {under} v16 H{10 + _WIDTH + _GAP_X + 60} v-13", dashed=True))
    middle = 10 + 3 * (_WIDTH + _GAP_X)
    parts.append(
        f'<text x="{middle}" y="{under + 13}" font-size="12" fill="#777">'
        "kept: four trajectories, each with its contacts and kernel</text>"
    )
    return "\n".join([*parts, "</svg>"]) + "\n"


def _box(left: int, top: int, title: str, text: str, *, first: bool) -> list[str]:
    middle = left + _WIDTH / 2
    found = [
        f'<rect x="{left}" y="{top}" width="{_WIDTH}" height="{_HEIGHT}" rx="6" fill="#eef3f8" stroke="#4a6a8a"/>',
        f'<text x="{middle}" y="{top + 24}" font-size="15" text-anchor="middle" fill="#123">{escape(title)}</text>',
        f'<text x="{middle}" y="{top + 44}" font-size="11.5" text-anchor="middle" fill="#345">{escape(text)}</text>',
    ]
    return found if first else [*found, _line(f"M{left - _GAP_X} {top + _HEIGHT // 2} h{_GAP_X - 2}")]


def _line(path: str, *, dashed: bool = False) -> str:
    dashes = ' stroke-dasharray="5 4"' if dashed else ""
    return f'<path d="{path}" fill="none" stroke="#555" stroke-width="1.4"{dashes} marker-end="url(#tip)"/>'


if __name__ == "__main__":
    Path(__file__).with_name("estimator.svg").write_text(drawing(), encoding="utf-8")
