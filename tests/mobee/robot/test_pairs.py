# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.robot.load import load_robot
from mobee.robot.pairs import joined_links
from mobee.robot.robot import Robot
from mobee.robot.xml.read import read_robot
from tests.mobee.robot.robot_files import robot_file


def chain(folder: Path, *extra: str, steps: tuple[float, ...] = (0.3, 0.3, 0.3), hand: int = -1) -> Robot:
    """Base b, then joints j0, j1, ... `steps` apart, a solid and a field on each link."""
    shapes = '<sphere name="s{0}" radius="0.01"/><sphere name="f{0}" radius="0.1" field="true"/>'
    lines = ['<bodypart name="arm"><link name="b"/>', shapes.format("b")]
    for k, step in enumerate(steps):
        flag = 'noSelfCollision="true"' if k == hand else ""
        lines.append(f'<link x="{step}"><motor name="j{k}" minPos="-1" maxPos="1"><joint z="1" {flag}>{shapes.format(k)}')
    lines.append("</joint></motor></link>" * len(steps) + "</bodypart>")
    return read_robot(robot_file(folder, *lines, *extra))


def pairs_of(robot: Robot, role: str = "solid") -> set[str]:
    pairs = robot.solid_pairs if role == "solid" else robot.field_pairs
    return {robot.shapes[i].name[1:] + robot.shapes[j].name[1:] for i, j in pairs}


def test_only_links_that_share_a_joint_are_joined_in_a_stretched_chain(tmp_path: Path) -> None:
    assert pairs_of(chain(tmp_path)) == {"b1", "b2", "02"}


def test_joints_that_are_one_place_join_all_links_that_meet_there(tmp_path: Path) -> None:
    robot = chain(tmp_path, steps=(0.3, 0.04, 0.04))
    assert pairs_of(robot) == set()
    assert joined_links(robot.joints).keys() == {frozenset(pair) for pair in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))}


@pytest.mark.parametrize(("span", "pairs"), [(0.5, {"b1", "b2"}), (0.04, set())])
def test_a_slide_that_leads_away_from_its_place_is_no_part_of_it(tmp_path: Path, span: float, pairs: set[str]) -> None:
    ball = '<sphere name="s{}" radius="0.01"/>'
    robot = read_robot(
        robot_file(
            tmp_path,
            f'<bodypart name="arm">{ball.format("b")}<motor name="lift" unit="m" minPos="0" maxPos="{span}"><joint z="1" type="prismatic">',
            f'{ball.format(0)}<motor name="pan" minPos="-90" maxPos="90"><joint z="1">{ball.format(1)}',
            f'<motor name="tilt" minPos="-90" maxPos="90"><joint y="1">{ball.format(2)}</joint></motor></joint></motor>',
            "</joint></motor></bodypart>",
        )
    )
    assert pairs_of(robot) == pairs


def test_a_hand_is_not_tested_against_itself(tmp_path: Path) -> None:
    assert pairs_of(chain(tmp_path, steps=(0.3, 0.3, 0.3, 0.3))) == {"b1", "b2", "b3", "02", "03", "13"}
    assert pairs_of(chain(tmp_path, steps=(0.3, 0.3, 0.3, 0.3), hand=1)) == {"b1", "b2", "b3", "02", "03"}


def test_fields_of_one_part_are_not_tested_against_each_other(tmp_path: Path) -> None:
    assert pairs_of(chain(tmp_path), "field") == set()


def test_ignored_links_are_left_out_for_the_role_that_is_named(tmp_path: Path) -> None:
    assert pairs_of(chain(tmp_path, '<ignore first="b" second="j1"/>')) == {"b2", "02"}
    assert pairs_of(chain(tmp_path, '<ignore first="j1" second="b" role="solid"/>')) == {"b2", "02"}
    assert pairs_of(chain(tmp_path, '<ignore first="b" second="j1" role="field"/>')) == {"b1", "b2", "02"}


def test_the_icubs_clusters_are_its_anatomy() -> None:
    robot = load_robot("icub")
    joined = {frozenset(robot.links[k] for k in pair) for pair in joined_links(robot.joints)}
    for first, second in (("chest", "l_shoulder_3"), ("root_link", "chest"), ("chest", "head"), ("l_shoulder_3", "l_forearm")):
        assert frozenset((first, second)) in joined
    for first, second in (("chest", "l_forearm"), ("l_shoulder_3", "l_hand"), ("l_shoulder_1", "r_shoulder_1"), ("head", "l_shoulder_1")):
        assert frozenset((first, second)) not in joined


def names_of(robot: Robot, pair: frozenset[int]) -> str:
    return " ".join(sorted(robot.links[k] for k in pair))


def test_every_pair_of_links_is_tested_or_has_its_reason(tmp_path: Path) -> None:
    robot = chain(tmp_path, '<ignore first="b" second="j2"/>', steps=(0.3, 0.04, 0.3, 0.3, 0.3), hand=3)
    assert {names_of(robot, pair): reason for pair, reason in robot.untested.items()} == {
        "b j0": "joined at a cluster of joints (j0, j1)",
        "b j1": "joined at a cluster of joints (j0, j1)",
        "j0 j1": "joined at a cluster of joints (j0, j1)",
        "j1 j2": "joined at j2",
        "j2 j3": "joined at j3",
        "j3 j4": "joined at j4",
        "b j2": "the file says so, line 10",
    }
    tested = {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in robot.solid_pairs}
    assert tested | robot.untested.keys() == {frozenset((a, b)) for a in range(6) for b in range(a)}
    assert not tested & robot.untested.keys()


def test_a_hand_has_its_joint_as_reason(tmp_path: Path) -> None:
    robot = chain(tmp_path, steps=(0.3, 0.3, 0.3, 0.3, 0.3), hand=1)
    hand = {names_of(robot, pair) for pair, reason in robot.untested.items() if reason == "same hand (noSelfCollision of joint j1)"}
    assert hand == {"j1 j3", "j1 j4", "j2 j4"}  # links that a joint connects have this reason


def test_a_pair_ignored_for_solids_only_is_untested_unless_its_fields_meet(tmp_path: Path) -> None:
    one_part = chain(tmp_path, '<ignore first="b" second="j1" role="solid"/>')
    assert one_part.untested[frozenset((0, 2))] == "the file says so, line 8"
    assert frozenset((0, 2)) not in chain(tmp_path, '<ignore first="b" second="j1" role="field"/>').untested


def test_of_the_shipped_robots_every_pair_of_links_with_solids_is_tested_or_has_a_reason() -> None:
    for name in ("icub", "icub_2014", "katana", "icub_katana"):
        robot = load_robot(name)
        bearing = sorted({shape.link for shape in robot.shapes if shape.role == "solid"})
        tested = {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in (*robot.solid_pairs, *robot.field_pairs)}
        assert {frozenset((a, b)) for a in bearing for b in bearing if a < b} <= tested | robot.untested.keys()
        assert not tested & robot.untested.keys()
