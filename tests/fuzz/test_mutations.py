# SPDX-License-Identifier: Apache-2.0
"""A few hundred seeded mutations of shipped files through the readers: the fuzzers' idea in the seconds that every test run has."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from mobee.errors import InvalidValue, RobotFileError
from mobee.learning.record import load_learned
from mobee.robot.load import load_robot
from tests.fuzz import files
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


def changed(content: bytes, rng: random.Random) -> bytes:
    """The content with a byte of another value, or without its end."""
    at = rng.randrange(len(content))
    return content[:at] + (b"" if rng.random() < 0.2 else bytes([rng.randrange(256)]) + content[at + 1 :])


@pytest.mark.parametrize("name", ["scenario", "roadmap", "store", "recording", "message"])
def test_a_changed_file_or_message_is_read_or_refused(name: str, tmp_path: Path) -> None:
    rng, seeds = random.Random(name), getattr(files, f"{name}_seeds")()
    feed = getattr(files, f"feed_{name}")
    assert any(feed(seed, tmp_path) for seed in seeds)
    answers = [feed(changed(rng.choice(seeds), rng), tmp_path) for _ in range(100)]
    assert sum(answers) > 0


def test_a_record_with_a_setting_that_no_space_has_is_refused(tmp_path: Path) -> None:
    content = files.store_seeds()[0]
    assert b"neighbours" in content
    with pytest.raises(InvalidValue, match="damaged"):
        path = tmp_path / "given.sqlite"
        path.write_bytes(content.replace(b"neighbours", b"neighbourx"))
        load_learned(path, "arm", load_robot("katana"))


def test_a_message_that_names_no_file_is_a_finding(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="a message without a file"):
        check_message(RobotFileError("something is wrong"), tmp_path)
    check_message(RobotFileError(f"{tmp_path}/given.xml:3: something is wrong"), tmp_path)
