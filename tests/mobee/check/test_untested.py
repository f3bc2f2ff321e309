# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest

from mobee.check import untested_groups
from mobee.check.touching import SAME_LINK, SAME_PART
from mobee.robot.load import load_robot, shipped_robots
from tests.mobee.check.arm import arm


@pytest.mark.parametrize("name", shipped_robots())
def test_tested_and_untested_pairs_are_all_pairs(name: str) -> None:
    robot = load_robot(name)
    groups = untested_groups(robot)
    for role, tested, left_out in (
        ("solid", robot.solid_pairs, sum(group.solids for group in groups)),
        ("field", robot.field_pairs, sum(group.fields for group in groups)),
    ):
        count = sum(shape.role == role for shape in robot.shapes)
        assert len(tested) + left_out == len(list(combinations(range(count), 2)))


def test_links_are_grouped_by_the_reason_that_the_reader_gave(tmp_path: Path) -> None:
    robot = replace(arm(tmp_path), untested={frozenset((0, 1)): "joined", frozenset((1, 2)): "joined"})
    groups = {group.reason: group for group in untested_groups(robot)}
    assert groups["joined"].links == (("base", "pan"), ("pan", "bend"))
    assert (groups["joined"].solids, groups["joined"].fields) == (2, 2)
    assert groups[SAME_PART].links == (("base", "bend"),)
    assert groups[SAME_PART].solids == 0


def test_shapes_of_one_link_are_rigid(tmp_path: Path) -> None:
    robot = arm(tmp_path, ("<marker", '<sphere name="palm" radius="0.02"/><marker'))
    (same,) = [group for group in untested_groups(robot) if group.reason == SAME_LINK]
    assert (same.links, same.solids, same.fields) == ((("bend", "bend"),), 1, 0)


def test_reasons_that_differ_in_a_name_only_are_of_one_kind(tmp_path: Path) -> None:
    robot = replace(arm(tmp_path), untested={frozenset((0, 1)): "adjacent: joint pan", frozenset((1, 2)): "adjacent: joint bend"})
    assert [group.kind for group in untested_groups(robot) if group.reason.startswith("adjacent")] == ["adjacent"] * 2


def test_reasons_of_joined_robots_are_of_the_kinds_that_they_are_alone() -> None:
    groups = untested_groups(load_robot("icub_katana"))
    assert any(group.reason.endswith("(katana)") for group in groups)
    assert not any("katana" in group.kind for group in groups)
