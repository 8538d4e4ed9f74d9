"""A sheet as a PDF or SVG file: vectors at true size."""

from __future__ import annotations

from html import escape

from drivers.camera.printing.print_layout import Area, Line, Sheet
from drivers.core.installed.extras import require_package

_CUT_GREY = 150
_POINTS_PER_mm = 72.0 / 25.4


def svg_text(sheet: Sheet) -> str:
    """The sheet as SVG; one unit is one millimetre."""
    width, height = sheet.size_mm
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}">',
        f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>',
        *(f'<path d="{_path(area)}" fill="#000000" fill-rule="evenodd"/>' for area in sheet.areas),
        *map(_svg_line, sheet.lines),
    ]
    for words in sheet.words:
        x, y = words.place
        style = f'font-family="Helvetica, Arial, sans-serif" font-size="{words.height_mm:g}"'
        parts.append(f'<text x="{x:.4f}" y="{y:.4f}" {style}>{escape(words.text)}</text>')
    return "\n".join([*parts, "</svg>", ""])


def _path(area: Area) -> str:
    return " ".join("M " + " L ".join(f"{x:.4f} {y:.4f}" for x, y in outline) + " Z" for outline in area.outlines)


def _svg_line(line: Line) -> str:
    (x1, y1), (x2, y2) = line.start, line.end
    colour = f"#{_CUT_GREY:02x}{_CUT_GREY:02x}{_CUT_GREY:02x}" if line.grey else "#000000"
    ends = f'x1="{x1:.4f}" y1="{y1:.4f}" x2="{x2:.4f}" y2="{y2:.4f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{line.width_mm:g}"/>'


def pdf_bytes(sheet: Sheet) -> bytes:
    """The sheet as PDF, made for printing at 100 %: it asks viewers not to scale it."""
    require_package("fpdf")
    from fpdf import FPDF, ViewerPreferences
    from fpdf.drawing import PaintedPath
    from fpdf.enums import IntersectionRule, PathPaintRule

    pdf = FPDF(unit="mm", format=sheet.size_mm)
    pdf.set_compression(False)
    pdf.set_auto_page_break(False)
    pdf.set_title("tactile-lab markers")
    pdf.viewer_preferences = ViewerPreferences(print_scaling="None")
    pdf.add_page()
    for area in sheet.areas:
        path = PaintedPath()
        for outline in area.outlines:
            path.move_to(*map(float, outline[0]))
            for x, y in outline[1:]:
                path.line_to(float(x), float(y))
            path.close()
        path.style.fill_color, path.style.stroke_color = "#000000", None
        path.style.paint_rule = PathPaintRule.FILL_EVENODD
        path.style.intersection_rule = IntersectionRule.EVENODD
        with pdf.drawing_context() as context:
            context.add_item(path)
    for line in sheet.lines:  # as areas: a stroke's caps would make it longer by its width
        pdf.set_fill_color(_CUT_GREY if line.grey else 0)
        pdf.rect(*line.area_mm, style="F")
    pdf.set_text_color(0)
    for words in sheet.words:
        pdf.set_font("Helvetica", size=words.height_mm * _POINTS_PER_mm)
        pdf.text(*words.place, words.text)
    return bytes(pdf.output())
