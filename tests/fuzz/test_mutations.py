# SPDX-License-Identifier: Apache-2.0
"""A few hundred seeded mutations of shipped files through the readers: the fuzzers' idea in the seconds that every test run has."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from mobee.errors import RobotFileError
from tests.fuzz.mutations import mutated
from tests.fuzz.readers import SEEDS, SHIPPED, check_message, feed_urdf, feed_xml, urdf_seeds, words, xml_seeds

TIMES = {"icub": 15, "icub_2014": 15, "icub_katana": 15, "katana": 80, "table": 30, "table_2014": 30, "every_tag": 150}
FILES = [SHIPPED / "robots" / f"{name}.xml" for name in ("icub", "icub_2014", "icub_katana", "katana")] + [
    *(SHIPPED / "worlds" / f"{name}.xml" for name in ("table", "table_2014")),
    SEEDS / "every_tag.xml",
]

pytestmark = pytest.mark.timeout(60)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_changed_robot_or_world_is_read_or_refused_in_plain_words(path: Path, tmp_path: Path) -> None:
    rng, names, text = random.Random(path.stem), words(xml_seeds()), path.read_text(encoding="utf-8")
    assert feed_xml(text.encode(), tmp_path)
    answers = [feed_xml(mutated(text, rng, names).encode(), tmp_path) for _ in range(TIMES[path.stem])]
    assert 0 < sum(answers) < len(answers)  # the changes are neither void nor all fatal


def test_a_changed_urdf_with_its_srdf_and_meshes_is_read_or_refused_in_plain_words(tmp_path: Path) -> None:
    seeds = urdf_seeds()
    rng, names, text = random.Random("urdf"), words(seeds), seeds[0].decode("utf-8", "surrogateescape")
    assert feed_urdf(seeds[0], tmp_path)
    answers = [feed_urdf(mutated(text, rng, names).encode("utf-8", "surrogateescape"), tmp_path) for _ in range(80)]
    assert 0 < sum(answers) < len(answers)


def test_a_message_that_names_no_file_is_a_finding(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="a message without a file"):
        check_message(RobotFileError("something is wrong"), tmp_path)
    check_message(RobotFileError(f"{tmp_path}/given.xml:3: something is wrong"), tmp_path)
