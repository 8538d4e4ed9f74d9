"""The page as a whole."""

from __future__ import annotations

from tactile_lab.report import doubts, listings, sections
from tactile_lab.report.content import ReportContent
from tactile_lab.report.markup import Markup, element, join

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""Forbids the browser to load anything from the network, whatever the page contains."""


def page(content: ReportContent) -> str:
    """The report as one self-contained HTML document."""
    title = f"{content.facts.headline} · tactile SLAM"
    head = element(
        "head",
        Markup('<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'),
        element("title", title),
        element("style", Markup(sections.resource("style.css"))),
    )
    body = element(
        "main",
        sections.head(content),
        listings.stops_card(content.course),
        sections.key_figures(content),
        doubts.doubts_card(content),
        sections.shape_section(content),
        listings.body_card(content.measured),
        sections.tracking_section(content),
        listings.grasp_section(content),
        listings.decisions_card(content.course),
        listings.evaluation_section(content),
        listings.origin_section(content),
        element(
            "footer", "Lengths in millimetres, angles in degrees. The data files are next to this page in results/."
        ),
    )
    script = [] if content.surface is None else [element("script", Markup(sections.resource("viewer.js")))]
    return f"<!doctype html>\n{element('html', head, element('body', join([body, *script])), lang='en')}\n"
