# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tests.mobee.check.arm import arm, named


def test_a_marker_that_no_motor_moves_is_found(tmp_path: Path) -> None:
    (finding,) = named(arm(tmp_path, ('<bodypart name="arm">', '<bodypart name="arm"><marker name="foot"/>')), "marker")
    assert finding.what == "no motor moves marker 'foot': it sits on link 'base'"


def test_a_marker_behind_a_moved_joint_is_none(tmp_path: Path) -> None:
    assert named(arm(tmp_path, ("<marker", '<marker name="wrist"/><marker')), "marker") == []


def test_the_many_frames_of_a_urdf_are_one_note(tmp_path: Path) -> None:
    still = ('<bodypart name="arm">', '<bodypart name="arm"><marker name="foot"/><marker name="plate" px="0.1"/>')
    robot = replace(arm(tmp_path, still), where={("marker", "foot"): "toy.urdf:7", ("marker", "plate"): "toy.urdf:8"})
    (finding,) = named(robot, "marker")
    assert (finding.severity, finding.where) == ("note", "toy.urdf:7")
    assert finding.what == "2 markers that no motor moves: foot, plate"
