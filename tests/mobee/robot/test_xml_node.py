# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.errors import RobotFileError
from mobee.robot.xml.node import read_xml

BOMB = """<?xml version="1.0"?>
<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>
<r x="&b;"/>
"""
STOLEN = """<?xml version="1.0"?>
<!DOCTYPE r [<!ENTITY secret SYSTEM "file:///etc/hostname">]>
<r>&secret;</r>
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "given.xml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("text", [BOMB, STOLEN], ids=["entity bomb", "external entity"])
def test_entities_are_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(RobotFileError, match=r"given.xml:\d+: entities and external references are refused"):
        read_xml(written(tmp_path, text))


def test_a_plain_doctype_is_welcome(tmp_path: Path) -> None:
    assert read_xml(written(tmp_path, "<!DOCTYPE Robot>\n<Robot/>")).tag == "robot"


def test_nodes_remember_their_lines(tmp_path: Path) -> None:
    root = read_xml(written(tmp_path, "<a>\n <b/>\n\n <c>\n  <d/></c>\n</a>"))
    b, c = root
    assert (root.line, b.line, c.line, c.children[0].line) == (1, 2, 4, 5)


def test_broken_xml_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"given.xml:2: not well-formed XML: mismatched tag in column 5. Close every tag"):
        read_xml(written(tmp_path, "<a><b>\n  </a>"))


@pytest.mark.parametrize(
    ("text", "says"), [("", "not well-formed XML"), ("no xml at all", "not well-formed XML"), ("\x00\x01", "not well-formed XML")]
)
def test_a_file_that_is_no_xml_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(RobotFileError, match=f"given.xml:1: {says}"):
        read_xml(written(tmp_path, text))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="nowhere.xml: cannot be read .No such file"):
        read_xml(tmp_path / "nowhere.xml")


def test_endless_nesting_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="nested more than 2000 elements deep"):
        read_xml(written(tmp_path, "<a>" * 5000 + "</a>" * 5000))
