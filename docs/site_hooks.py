"""What the site needs beyond the pages as they lie in the repository; run by mkdocs, see mkdocs.yml."""

from __future__ import annotations

import ast
import posixpath
import re
from pathlib import Path
from runpy import run_path
from typing import Any

from mkdocs.structure.files import File, Files

REPOSITORY = Path(__file__).resolve().parents[1]
_BESIDE = {"README.md": "index.md", "CONTRIBUTING.md": "CONTRIBUTING.md", "CHANGELOG.md": "CHANGELOG.md"}
"""Pages beside the folder of documents, and what they are called on the site."""

_EXPERIMENTS = REPOSITORY / "tactile_lab" / "experiments"
_SOURCES = run_path(str(_EXPERIMENTS / "execution" / "source_version.py"))["version"]()
_AGES = run_path(str(_EXPERIMENTS / "results" / "page_ages.py"))
"""Both need nothing but Python: the site is made without the packages' requirements."""

_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s#:]+)(#[^)\s]*)?\)")
_ROLE = re.compile(r":(?:class|func|meth|mod|data|attr|exc):(?=<code>|`)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages beside the folder of documents, and one with the documentation of every public name."""
    for name, uri in _BESIDE.items():
        text = re.sub(r"\]\(docs/", "](", (REPOSITORY / name).read_text(encoding="utf-8"))
        files.append(File.generated(config, uri, content=text))
    files.append(File.generated(config, "library-code.md", content=_public_names()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links to files that the site does not have, such as code, become their text: it names the file already.

    Results say whether they are older than the code that the site is made of.
    """
    folder = posixpath.dirname(page.file.src_uri)

    def rewritten(link: re.Match[str]) -> str:
        picture, text, target, anchor = link.groups()
        uri = posixpath.normpath(posixpath.join(folder, target))
        if (beside := _BESIDE.get(uri.removeprefix("../"))) is not None and uri.startswith("../"):
            return f"{picture}[{text}]({posixpath.relpath(beside, folder or '.')}{anchor or ''})"
        in_repository = (REPOSITORY / "docs" / uri).exists() or (REPOSITORY / uri).exists()
        known = files.get_file_from_path(uri) is not None
        return link.group() if known or not in_repository else text

    answer = _AGES["answer_overview" if page.file.src_uri == "results.md" else "answer"]
    markdown = answer(markdown, _SOURCES)
    return _LINK.sub(rewritten, "\n".join(map(_without_references, markdown.split("\n"))))


def _without_references(line: str) -> str:
    """No page uses Markdown's references: brackets after brackets are text, such as a pattern."""
    return line if "`" in line else line.replace("][", "]\\[")


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """Docstrings name classes by roles that only other tools show."""
    return _ROLE.sub("", html)


def _public_names() -> str:
    """A page that shows the docstring of each public name where it is defined."""
    module = ast.parse((REPOSITORY / "tactile_lab" / "__init__.py").read_text(encoding="utf-8"))
    places = next(
        ast.literal_eval(each.value)
        for each in module.body
        if isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == "_PLACES"
    )
    return "# Documentation of the public names\n\n" + "".join(
        f"::: {place}.{name}\n\n" for name, place in sorted(places.items(), key=lambda item: item[0].lower())
    )
