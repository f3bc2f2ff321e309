# SPDX-License-Identifier: Apache-2.0
"""Settings of Sphinx for the documentation's site; docs/site/build.py prepares the pages and calls Sphinx."""

from __future__ import annotations

import re
from functools import cache
from importlib import metadata
from typing import Any

from sphinx.search.en import SearchEnglish

project = "MoBeE"
author = "The MoBeE developers"
copyright = author  # noqa: A001  (the name that Sphinx asks for)
release = version = metadata.version("mobee")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "docs/index"
html_theme = "furo"
html_title = "MoBeE"
html_copy_source = False
html_show_sourcelink = False

myst_heading_anchors = 6  # a link to page.md#heading is checked, by the rule with which GitHub names headings

toc_object_entries = False  # a page's headings are enough, and every page of the site holds the contents of all

autodoc_member_order = "bysource"
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Bools", "Ints")}
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_numpy_docstring = False
suppress_warnings = ["ref.python"]  # annotations hold short names, such as Pose, which the library and the bus both have


class _Stems(SearchEnglish):
    """The English search of Sphinx, which computes the stem of each word once."""

    def __init__(self, options: dict[str, str]) -> None:
        super().__init__(options)
        self.stem = cache(self.stem)  # type: ignore[method-assign]  # for this object alone: the method of the class stays


def _as_restructured_text(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Make of a docstring's Markdown, `code` and plain text, what reStructuredText shows in the same way."""
    del app, what, name, thing, options
    for at, line in enumerate(lines):
        pieces = re.split(r"(`+[^`]+`+)", line)
        pieces[::2] = [re.sub(r"([*|])|_(?=\W|$)", lambda found: "\\" + found[0], piece) for piece in pieces[::2]]
        pieces[1::2] = [f"``{piece.strip('`')}``" for piece in pieces[1::2]]
        lines[at] = "".join(pieces)


def setup(app: Any) -> None:
    """Register the search, and the conversion of docstrings, which is done before that of napoleon."""
    app.add_search_language(_Stems)
    app.connect("autodoc-process-docstring", _as_restructured_text, priority=100)
