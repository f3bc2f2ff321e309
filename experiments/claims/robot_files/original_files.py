# SPDX-License-Identifier: Apache-2.0
"""Search for robot and world files of 2010 to 2014 in the histories of Git repositories, and in plain folders."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mobee.errors import InvalidValue

ROOTS: dict[bytes, Literal["robot", "world"]] = {b"<zeropositionkinematictree": "robot", b"<worldlist": "world"}
PRESENT_VERSION = b'version="2.0"'


@dataclass(frozen=True)
class Original:
    """One distinct file of 2010 to 2014, and where it was first found.

    `hash`: Git's hash of the content.  `date`: of the oldest commit that contains it, as text; "" in a folder without a history.  `path`:
    below the repository or folder.
    """

    kind: Literal["robot", "world"]
    hash: str  # of Git: sha1 of "blob", length and content
    date: str  # of the oldest commit that holds it; empty in a folder without a history
    repository: str
    path: str
    content: bytes

    @property
    def name(self) -> str:
        """The date, the name and the first digits of the hash of the file, joined by underscores; unique for every content."""
        return "_".join(word for word in (self.date, Path(self.path).stem, self.hash[:8]) if word)


def find_originals(folders: list[Path]) -> list[Original]:
    """Return every distinct robot or world file in a MoBeE format before version 2.0 that is found in the given folders.

    If Git repositories below a folder have such files in their histories, these files are returned; otherwise such files below the folder
    itself, with names that end in ".xml", are returned.  Robots come before worlds, and older files before newer ones.

    Raises InvalidValue for a folder that does not exist, and if Git is not installed.
    """
    found: dict[str, Original] = {}
    for folder in folders:
        if not folder.is_dir():
            raise InvalidValue(f"{folder} is no folder. Give folders with checkouts of kailfrank/MoBeE and Juxi/icVision.")
        repositories = sorted(_repositories(folder))
        for original in [one for repository in repositories for one in _in_history(repository)] or _in_folder(folder):
            before = found.get(original.hash)
            if before is None or (original.date, original.path) < (before.date, before.path):
                found[original.hash] = original
    return sorted(found.values(), key=lambda one: (one.kind, one.date, one.path, one.hash))


def _repositories(folder: Path) -> Iterator[Path]:
    """Yield repositories at most three folders deep, with or without a work tree."""
    for depth in range(4):
        for head in folder.glob("/".join(["*"] * depth + ["HEAD"])):
            if (head.parent / "objects").is_dir():
                yield head.parent
    for depth in range(4):
        for git in folder.glob("/".join(["*"] * depth + [".git"])):
            if git.is_dir() and not (git / "HEAD").exists():
                yield git


def _git(repository: Path, *words: str) -> bytes:
    try:
        return subprocess.run(["git", "-C", str(repository), *words], capture_output=True, check=False).stdout
    except FileNotFoundError as error:
        raise InvalidValue("git is not installed, and the histories cannot be read without it.") from error


def _in_history(repository: Path) -> Iterator[Original]:
    """Yield every version of every XML file of any commit."""
    name = repository.parent.name if repository.name in (".git", "repo") else repository.name
    options = ("--all", "-m", "--root", "--raw", "--no-renames", "--no-abbrev", "--format=@%ad", "--date=short")
    log = _git(repository, "log", *options, "--", "*.xml", "*.XML")
    date = ""
    for line in log.decode("utf-8", "replace").splitlines():
        if line.startswith("@"):
            date = line[1:]
        elif line.startswith(":") and "\t" in line:
            meta, path = line.split("\t", 1)
            blob = meta.split()[3]
            content = _git(repository, "cat-file", "blob", blob) if blob.strip("0") else b""
            kind = _kind(content)
            if kind:
                yield Original(kind, blob, date, name, path, content)


def _in_folder(folder: Path) -> Iterator[Original]:
    for path in sorted(folder.rglob("*.xml")):
        content = path.read_bytes()
        kind = _kind(content)
        if kind:
            digest = hashlib.sha1(b"blob %d\0" % len(content) + content, usedforsecurity=False).hexdigest()
            yield Original(kind, digest, "", folder.name, str(path.relative_to(folder)), content)


def _kind(content: bytes) -> Literal["robot", "world"] | None:
    low = content.lower()
    return next((kind for root, kind in ROOTS.items() if root in low and PRESENT_VERSION not in low), None)
