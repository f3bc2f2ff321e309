# SPDX-License-Identifier: Apache-2.0
"""Every tracked file has a licence, named in its first lines or in REUSE.toml, and the text of each licence is in LICENSES/."""

from __future__ import annotations

import fnmatch
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ANNOTATIONS = tomllib.loads((ROOT / "REUSE.toml").read_text())["annotations"]
NAMED = re.compile(rb"SPDX-License-Identifier: ([\w.-]+)")
CC = "CC-BY-SA-4.0"

DERIVED_FROM_ICUB_MODELS = {
    "docs/figures/film.gif",
    "docs/figures/live.png",
    "experiments/bench/data/bench_model.json",
    "mobee/robot/robots/icub.xml",
    "mobee/robot/robots/icub_katana.xml",
    "mobee/simulation/identified/icub.toml",
    "services/robot_sim/solid_pairs.json",
    "tests/data/icub_poses.json",
}


def tracked() -> list[str]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    return [name for name in listing.split("\0") if name and (ROOT / name).is_file()]


def licence_of(name: str) -> str | None:
    """The licence by the last table of REUSE.toml that fits, or by the file's own first lines, which come before a `closest` table."""
    tables = [one for one in ANNOTATIONS if any(fnmatch.fnmatchcase(name, path) for path in _listed(one["path"]))]
    own = NAMED.search(b"\n".join((ROOT / name).read_bytes().split(b"\n", 10)[:10]))
    if own and (not tables or tables[-1]["precedence"] == "closest"):
        return own[1].decode()
    return tables[-1]["SPDX-License-Identifier"] if tables else None


def _listed(paths: str | list[str]) -> list[str]:
    return [paths] if isinstance(paths, str) else paths


def test_every_file_has_a_licence_whose_text_is_here() -> None:
    texts = {path.stem for path in (ROOT / "LICENSES").iterdir()}
    assert texts == {"Apache-2.0", CC}
    assert {name: licence for name in tracked() if (licence := licence_of(name)) not in texts} == {}


def test_files_derived_from_icub_models_keep_their_licence() -> None:
    assert {name for name in tracked() if licence_of(name) == CC} == DERIVED_FROM_ICUB_MODELS


def test_every_path_of_reuse_toml_is_a_file() -> None:
    paths = [path for one in ANNOTATIONS for path in _listed(one["path"]) if "*" not in path]
    assert [path for path in paths if not (ROOT / path).is_file()] == []


@pytest.mark.parametrize("name", ["icub.xml", "icub_katana.xml"])
def test_a_robot_under_another_licence_says_so_at_its_head(name: str) -> None:
    head = (ROOT / "mobee/robot/robots" / name).read_text()[:1200]
    assert f"SPDX-License-Identifier: {CC}" in head


def test_the_icub_names_its_source_and_the_changes() -> None:
    head = (ROOT / "mobee/robot/robots/icub.xml").read_text()[:1200]
    for words in ("https://github.com/robotology/icub-models", "https://creativecommons.org/licenses/by-sa/4.0/", "Istituto", "Changed:"):
        assert words in head


def test_the_licence_at_the_root_is_that_of_the_code() -> None:
    assert (ROOT / "LICENSE").read_text() == (ROOT / "LICENSES/Apache-2.0.txt").read_text()
