# SPDX-License-Identifier: Apache-2.0
"""Build the documentation as a site: `python docs/site/build.py [FOLDER]` writes it into dist/site, or FOLDER.

The pages are the Markdown files of the repository; docs/index.md says in which section each stands.  Reference pages are made from
the docstrings of the public names and from the parsers of the command.  A link to a source file leads to a page that shows the file.
Nothing is read from the network.  A warning of Sphinx is an error: a page that is in no section, a link or a heading that is not there.
"""

from __future__ import annotations

import gc
import posixpath
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(HERE)]

import reference  # noqa: E402  (the file beside this one)

PAGES = ("*.md", "docs/*.md", "experiments/README.md", "mobee/robot/*/README.md")
INDEX, FIGURES = "docs/index.md", "docs/figures"
GENERATED = {"Reference": ("api/index", "api/command")}
"""Pages that only the site has, by their section."""

LINK = re.compile(r"(?<!!)(\[[^\]]*\]\()([^)#\s]+)([^)]*\))")


def main() -> int:
    """Build the site; return Sphinx's exit code."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist/site"
    return build(out)


def build(out: Path) -> int:
    """Write the site into a folder; return Sphinx's exit code."""
    from sphinx.cmd.build import main as sphinx

    gc.disable()  # all pages are kept until the end: there is no garbage, and the search for it takes a third of the time
    with tempfile.TemporaryDirectory() as folder:
        stage(Path(folder))
        code: int = sphinx(["-q", "-W", "--keep-going", "-b", "html", "-c", str(HERE), folder, str(out)])
    if code == 0:
        (out / "index.html").write_text('<meta http-equiv="refresh" content="0; url=docs/index.html">\n')
    return code


def stage(folder: Path) -> None:
    """Write all pages, in Sphinx's form, and the figures into a folder."""
    shutil.copytree(ROOT / FIGURES, folder / FIGURES)
    pages = {path.relative_to(ROOT).as_posix(): path.read_text() for pattern in PAGES for path in sorted(ROOT.glob(pattern))}
    pages |= reference.pages()
    sources: set[str] = set()
    for name, text in pages.items():
        pages[name] = _with_source_pages(name, text, set(pages), sources)
    pages |= {f"source/{source}.md": _source_page(source) for source in sources}
    pages[INDEX] += toctrees(pages[INDEX])
    for name, text in pages.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def toctrees(index: str) -> str:
    """The sections of the site: below each bold heading of the index, the pages that it links to, each page once."""
    seen: set[str] = set()
    parts = re.split(r"^\*\*(.+)\*\*$", index, flags=re.MULTILINE)
    text = ""
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        linked = [target for _, target, _ in LINK.findall(body) if target.endswith(".md") and target not in seen]
        names = [*dict.fromkeys(target.removesuffix(".md") for target in linked), *GENERATED.get(title, ())]
        seen.update(linked)
        text += "\n".join(("", "```{toctree}", ":hidden:", ":titlesonly:", f":caption: {title}", "", *names, "```", ""))
    return text


def _with_source_pages(page: str, text: str, pages: set[str], sources: set[str]) -> str:
    """The text with its links to files that are no pages replaced by links to pages that show them; those files are added to `sources`."""

    def replaced(link: re.Match[str]) -> str:
        before, target, after = link.groups()
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page), target))
        if "://" in target or target.startswith("mailto:") or path in pages or path.startswith(FIGURES) or not (ROOT / path).exists():
            return link[0]
        sources.add(path)
        return f"{before}{posixpath.relpath(f'source/{path}.md', posixpath.dirname(page) or '.')}{after}"

    return "\n".join(LINK.sub(replaced, line) if not fenced else line for line, fenced in _lines(text)) + "\n"


def _lines(text: str) -> Iterator[tuple[str, bool]]:
    """Each line, and whether it stands in a block of code."""
    fenced = False
    for line in text.splitlines():
        fence = line.lstrip().startswith("```")
        yield line, fenced or fence
        fenced ^= fence


def _source_page(source: str) -> str:
    """A page that shows a file, or all Python files of a folder."""
    path = ROOT / source
    files = sorted(path.glob("*.py")) if path.is_dir() else [path]
    blocks = [f"```{'python' if file.suffix == '.py' else 'text'}\n{file.read_text().rstrip()}\n```\n" for file in files]
    if path.is_dir():
        blocks = [f"## {file.name}\n\n{block}" for file, block in zip(files, blocks, strict=True)]
    return f"---\norphan: true\n---\n\n# {source}\n\n" + "\n".join(blocks)


if __name__ == "__main__":
    raise SystemExit(main())
