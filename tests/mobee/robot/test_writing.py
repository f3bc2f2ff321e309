# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.robot.writing import write_whole


def test_a_file_that_is_replaced_keeps_its_mode_and_the_links_to_it(tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    target, link = tmp_path / "shared" / "arm.xml", tmp_path / "arm.xml"
    target.write_text("old")
    target.chmod(0o600)
    link.symlink_to(Path("shared") / "arm.xml")
    assert write_whole(link, b"new") == link
    assert link.is_symlink() and target.read_bytes() == b"new"
    assert target.stat().st_mode & 0o777 == 0o600
    assert {path.name for path in tmp_path.rglob("*")} == {"shared", "arm.xml"}


def test_a_link_to_a_file_that_is_not_there_makes_the_file(tmp_path: Path) -> None:
    link = tmp_path / "arm.xml"
    link.symlink_to("new.xml")
    write_whole(link, b"new")
    assert link.is_symlink() and (tmp_path / "new.xml").read_bytes() == b"new"


@pytest.mark.parametrize("name", ["file/arm.xml", f"{'a' * 300}.xml"])
def test_an_error_of_a_parent_that_is_a_file_or_of_a_long_name_names_the_given_path(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=name) as caught:
        write_whole(tmp_path / name, b"new")
    assert caught.value.filename == str(tmp_path / name)
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


def test_an_error_names_the_given_path_and_leaves_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "folder.xml"
    folder.mkdir()
    with pytest.raises(OSError, match="folder.xml") as caught:
        write_whole(folder, b"new")
    assert caught.value.filename == str(folder)
    assert list(tmp_path.iterdir()) == [folder]
