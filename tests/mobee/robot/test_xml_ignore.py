# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.arrays import Ints
from mobee.errors import RobotFileError
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from tests.mobee.robot.robot_files import TAIL

# A chain a, b, c far apart: a solid on each link, two fields on each of b and c, all of one part.
HEAD = '<ZeroPositionKinematicTree version="2.0" robotName="toy" adjacency="{0}">'
BODY = """<bodypart name="arm"><motor name="m1" minPos="-9" maxPos="9"/><motor name="m2" minPos="-9" maxPos="9"/><link name="a">
<sphere name="a" radius=".1"/>
<link x="1"><joint name="b" motor="m1" z="1"><sphere name="b" radius=".1"/><sphere name="bf" radius=".2" field="true"/>
<link x="1"><joint name="c" motor="m2" z="1"><sphere name="c" radius=".1"/><sphere name="cf" radius=".2" field="true"/>
</joint></link></joint></link></link></bodypart>"""


def read(folder: Path, *ignores: str, adjacency: str = "listed") -> Robot:
    path = folder / "toy.xml"
    path.write_text("\n".join([HEAD.format(adjacency), BODY, *ignores, TAIL]))
    return load_robot(path)


def pairs(robot: Robot, table: Ints) -> set[str]:
    return {"".join(sorted((robot.shapes[a].name, robot.shapes[b].name))) for a, b in table.tolist()}


def test_adjacency_listed_excludes_only_named_pairs(tmp_path: Path) -> None:
    robot = read(tmp_path)
    assert pairs(robot, robot.solid_pairs) == {"ab", "ac", "bc"}
    assert pairs(robot, robot.field_pairs) == {"bfcf"}
    assert robot.untested == {}
    joined = read(tmp_path, adjacency="joined")
    assert pairs(joined, joined.solid_pairs) == {"ac"}
    assert pairs(joined, joined.field_pairs) == set()


def test_links_are_left_out_with_the_reason_of_the_file(tmp_path: Path) -> None:
    robot = read(tmp_path, '<ignore first="b" second="c" reason="they meet"/>', '<ignore first="a" second="b" role="solid"/>')
    assert pairs(robot, robot.solid_pairs) == {"ac"}
    assert pairs(robot, robot.field_pairs) == set()
    assert robot.untested == {frozenset((1, 2)): "they meet", frozenset((0, 1)): "the file says so, line 8"}


def test_two_shapes_are_left_out(tmp_path: Path) -> None:
    robot = read(tmp_path, '<ignore first="b" second="c" of="shapes"/>')
    assert pairs(robot, robot.solid_pairs) == {"ab", "ac"}
    assert pairs(robot, robot.field_pairs) == {"bfcf"}
    assert robot.untested == {}


def test_a_part_is_left_out_in_one_role(tmp_path: Path) -> None:
    robot = read(tmp_path, '<ignore part="arm" role="field"/>')
    assert pairs(robot, robot.solid_pairs) == {"ab", "ac", "bc"}
    assert pairs(robot, robot.field_pairs) == set()


@pytest.mark.parametrize(
    ("tag", "message"),
    [
        ('<ignore first="b" second="d"/>', "second: unknown link 'd'. Valid: a, b, c"),
        ('<ignore first="b" second="cff" of="shapes"/>', "second: unknown shape 'cff'. Did you mean 'cf'"),
        ('<ignore first="b" second="b"/>', "second: is the first link again"),
        ('<ignore first="b" second="b" of="shapes"/>', "second: is the first shape again"),
        ('<ignore first="b" second="c" of="joints"/>', "of: unknown kind 'joints'. Valid: links, shapes"),
        ('<ignore part="amr"/>', "part: unknown part 'amr'. Did you mean 'arm'"),
        ('<ignore part="arm" role="body"/>', "role: unknown role 'body'. Valid: both, field, solid"),
    ],
)
def test_mistakes_are_answered_with_line_and_remedy(tmp_path: Path, tag: str, message: str) -> None:
    with pytest.raises(RobotFileError, match=f"toy.xml:7: <ignore> {message}"):
        read(tmp_path, tag)
