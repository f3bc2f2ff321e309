# SPDX-License-Identifier: Apache-2.0
"""The documentation builds as a site without a warning and without the network, and its links lead somewhere."""

from __future__ import annotations

import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import mobee
from mobee_cli.__main__ import VERBS

ROOT = Path(__file__).parents[2]


class Page(HTMLParser):
    """The links of a page, the files that it loads, and the places in it that a link can name."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.places: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value is not None}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag in {"img", "script", "link", "iframe"} and (address := given.get("src") or given.get("href")):
            self.loaded.append(address)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    nowhere = {"http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}  # what asks the network fails at once
    command = [sys.executable, ROOT / "docs/site/build.py", folder]
    built = subprocess.run(command, env={**os.environ, **nowhere}, capture_output=True, text=True, timeout=200)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in site.rglob("*.html")}


def test_every_page_of_the_repository_is_on_the_site(site: Path) -> None:
    names = [path.relative_to(ROOT).with_suffix(".html") for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"))]
    assert [str(name) for name in names if not (site / name).is_file()] == []


def test_every_link_and_picture_on_the_site_leads_to_something(site: Path, pages: dict[Path, Page]) -> None:
    broken = []
    for path, page in pages.items():
        for address in (*page.links, *page.loaded):
            parts = urlsplit(address)
            if parts.scheme or address.startswith("data:"):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            place = unquote(parts.fragment)
            if not target.is_file() or (place and target in pages and place not in pages[target].places):
                broken.append(f"{path.relative_to(site)}: {address}")
    assert broken == []


def test_the_site_loads_nothing_from_elsewhere(pages: dict[Path, Page]) -> None:
    assert {address for page in pages.values() for address in page.loaded if urlsplit(address).scheme in {"http", "https"}} == set()


def test_the_reference_has_every_public_name_with_its_docstring(site: Path, pages: dict[Path, Page]) -> None:
    places = set().union(*(page.places for path, page in pages.items() if path.parent.name == "api"))
    names = {getattr(getattr(mobee, name), "__name__", name).split(".")[-1] for name in mobee.__all__}
    assert {name for name in names if not any(place.split(".")[-1] == name for place in places)} == set()
    assert "bus_schema.messages.State" in places


def test_the_reference_has_the_options_of_every_verb(site: Path) -> None:
    text = (site / "docs/api/command.html").read_text()
    assert [verb for verb in VERBS if f"usage: mobee {verb}" not in text] == []
