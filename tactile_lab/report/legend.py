"""Samples of marks with their meaning, beside a picture."""

from __future__ import annotations

from tactile_lab.report.markup import Markup, element

_SAMPLES = {
    "contour": '<line class="contour" x1="3" y1="6" x2="21" y2="6" style="stroke:#21918c"/>',
    "guess": '<path class="guess" d="M1 6H23"/>',
    "contour_band": '<rect class="band" x="1" y="1" width="22" height="10"/>',
    "estimate": '<path class="estimate" d="M1 6H23"/>',
    "truth-fit": '<path class="truth-fit" d="M1 6H23"/>',
    "bound": '<rect class="band" x="1" y="1" width="22" height="10"/><path class="bound" d="M1 1H23"/>',
    "estimate-seen": '<path class="seen casing-seen" style="stroke-width:5" d="M1 6H23"/>'
    '<path class="seen estimate-seen" style="stroke-width:2.6" d="M1 6H23"/>',
    "truth-seen": '<path class="seen casing-seen" style="stroke-width:5" d="M1 6H23"/>'
    '<path class="seen truth-seen" style="stroke-width:2.6" d="M1 6H23"/>',
    "seen": '<circle class="contact-seen" cx="12" cy="6" r="3.2"/>',
    "truth": '<path class="truth" d="M1 6H23"/>',
    "contact": '<line class="normal" x1="6" y1="6" x2="21" y2="6"/><circle class="contact" cx="6" cy="6" r="4"/>',
}


def legend(keys: list[tuple[str, str]]) -> Markup:
    """Samples of marks with their meaning."""
    samples = [Markup(f'<svg viewBox="0 0 24 12" aria-hidden="true">{_SAMPLES[kind]}</svg>') for kind, _ in keys]
    return element("ul", *map(lambda s, k: element("li", s, k[1]), samples, keys), class_="legend")
