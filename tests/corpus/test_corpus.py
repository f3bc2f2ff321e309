# SPDX-License-Identifier: Apache-2.0
"""Files that must not be read: robots, worlds and URDFs, each with one fault, and some too large to be committed."""

from __future__ import annotations

import os
import re
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mobee.errors import RobotFileError
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.xml.read import read_robot
from tests.corpus.generated import ACCEPTED, REFUSED
from tests.corpus.phrases import PHRASES

CORPUS = Path(__file__).parent
LINE = re.compile(r":\d+: ")
VERBS = (
    "Add|Check|Choose|Close|Convert|Count|Divide|Draw|Give|Include|Join|Keep|Leave|Make|Move|Put|Remove|Rename|Save|Swap|Use|Valid|Write|"
    "A robot has|A robot needs|A URDF is|Did you|Its motors|Its root is|Names begin|The file ends|The first is|The root of"
)
REMEDY = re.compile(rf"[.?] ({VERBS})\b")

pytestmark = pytest.mark.timeout(20)  # a hang is an error; how long each takes is measured and printed below


@pytest.fixture(scope="module")
def slowest(request: pytest.FixtureRequest) -> dict[str, float]:
    """Seconds that each file took; the slowest is printed at the end."""
    times: dict[str, float] = {}
    request.addfinalizer(
        lambda: print(f"\nslowest of {len(times)} files: {max(times, key=times.__getitem__)}, {max(times.values()):.3f} s")
    )
    return times


def refusal(path: Path, read: Callable[[Path], object]) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(RobotFileError) as caught:
            read(path)
    return str(caught.value)


def test_every_file_of_the_corpus_has_its_phrase() -> None:
    files = {path.relative_to(CORPUS).as_posix() for folder in ("robots", "worlds", "urdf") for path in (CORPUS / folder).iterdir()}
    assert files == set(PHRASES)
    assert len(files) >= 60
    assert all(PHRASES.values())


@pytest.mark.parametrize("name", PHRASES)
def test_a_malformed_file_is_refused_with_file_line_problem_and_remedy(name: str, slowest: dict[str, float]) -> None:
    path = CORPUS / name
    start = time.perf_counter()
    message = refusal(path, load_world if name.startswith("worlds") else load_robot)
    slowest[name] = time.perf_counter() - start
    assert message.startswith(str(CORPUS)), message
    assert LINE.search(message), message
    assert PHRASES[name] in message
    assert REMEDY.search(message), message


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_too_large_to_be_committed_is_refused(tmp_path: Path, name: str, slowest: dict[str, float]) -> None:
    write, phrase = REFUSED[name]
    path = tmp_path / "given.xml"
    path.write_bytes(write())
    start = time.perf_counter()
    message = refusal(path, read_robot)
    slowest[name] = time.perf_counter() - start
    assert LINE.search(message), message
    assert phrase in message
    assert len(message) < 3000


@pytest.mark.parametrize("name", ACCEPTED)
def test_valid_files_that_resemble_malformed_ones_are_read(tmp_path: Path, name: str) -> None:
    path = tmp_path / "given.xml"
    path.write_bytes(ACCEPTED[name]())
    assert read_robot(path).motors


@pytest.mark.parametrize("read", [load_robot, load_world])
def test_an_unreadable_file_is_refused(tmp_path: Path, read: Callable[[Path], object]) -> None:
    folder = tmp_path / "folder.xml"
    folder.mkdir()
    with pytest.raises(RobotFileError, match="folder.xml: no such file"):
        read(folder)
    with pytest.raises(RobotFileError, match="no such file"):
        read(tmp_path / ("long" * 100 + ".xml"))


def test_a_folder_a_pipe_and_a_device_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"cannot be read \(Is a directory\)"):
        read_robot(tmp_path)
    os.mkfifo(tmp_path / "pipe.xml")
    for path in (tmp_path / "pipe.xml", Path("/dev/zero")):
        with pytest.raises(RobotFileError, match=r"cannot be read \(Not a regular file\)"):
            read_robot(path)
    with pytest.raises(RobotFileError, match="cannot be read"):
        read_robot(Path("a\0b.xml"))


@pytest.fixture
def as_nobody(tmp_path: Path) -> Iterator[None]:
    """Root may read everything, so a test about permissions runs as nobody."""
    path, user = tmp_path / "mine.xml", os.geteuid()
    path.write_text("<World/>")
    path.chmod(0)
    if user == 0:
        os.seteuid(65534)
    yield
    os.seteuid(user)


def test_a_file_without_permission_is_refused(tmp_path: Path, as_nobody: None) -> None:
    path = tmp_path / "mine.xml"
    with pytest.raises(RobotFileError, match=r"mine.xml: cannot be read \(Permission denied\). Check the path and its permissions"):
        read_robot(path)
