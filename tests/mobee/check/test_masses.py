# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.check import Finding, check_robot
from mobee.robot.load import load_robot
from tests.mobee.check.arm import SLIDE, arm, named

UPPER, FORE = '<link name="upper" x="-0.2" radius="0.02" field="0.06">', '<marker name="tip" nx="-1"/>'


def found(folder: Path, upper: str = '<mass value="2" px="-0.2"/>', fore: str = '<mass value="1" px="0.05"/>') -> list[Finding]:
    return named(arm(folder, (UPPER, UPPER + upper), (FORE, FORE + fore)), "mass")


def test_plausible_masses_cause_no_finding(tmp_path: Path) -> None:
    assert found(tmp_path) == []


def test_grams_are_warned_of(tmp_path: Path) -> None:
    warning, *heavy = found(tmp_path, '<mass value="2000"/>')
    assert warning.severity == "warning"
    assert warning.what == "the robot weighs 2001 kg; the heaviest link is 'pan' with 2000 kg"
    assert "divide by 1000" in warning.remedy
    assert heavy == []


def test_a_moving_link_without_a_mass_is_noted(tmp_path: Path) -> None:
    (note,) = found(tmp_path, fore="")
    assert (note.severity, note.what) == ("note", "1 moving link with solids and without a mass: bend")


def test_a_centre_far_from_its_link_is_warned_of(tmp_path: Path) -> None:
    warning, *_ = found(tmp_path, fore='<mass value="0.1" px="50"/>')
    assert warning.severity == "warning"
    assert warning.what.startswith("the centre of mass of link 'bend' lies 49.8 m away")
    assert "it is in metres" in warning.remedy


@pytest.mark.parametrize(("kilograms", "severity", "where"), [("25", "warning", "at home"), ("21", "note", "in some pose")])
def test_a_motor_that_cannot_hold_the_arm_is_named(tmp_path: Path, kilograms: str, severity: str, where: str) -> None:
    (finding,) = found(tmp_path, fore=f'<mass value="{kilograms}"/>')
    assert finding.severity == severity
    assert finding.what.startswith("motor 'bend' needs ") and where in finding.what and "40 N m" in finding.what


def test_the_weight_on_a_slide_is_a_force(tmp_path: Path) -> None:
    robot = arm(
        tmp_path, SLIDE[0], ('y="-1"', 'type="prismatic" z="1"'), (UPPER, f'{UPPER}<mass value="2"/>'), (FORE, f'{FORE}<mass value="10"/>')
    )
    (finding,) = named(robot, "mass")
    assert finding.what == "motor 'bend' needs 98.1 N to hold the robot at home; its largest force is 40 N"


def test_moments_of_inertia_that_cannot_be_are_noted(tmp_path: Path) -> None:
    (note,) = found(tmp_path, upper='<mass value="2" inertia="1 0 0 1 0 3"/>')
    assert note.severity == "note"
    assert note.what == "no rigid body can have the moments of inertia of pan"


def test_of_the_icub_only_the_weightless_fingers_and_eyes_are_noted() -> None:
    (note,) = [finding for finding in check_robot(load_robot("icub")) if finding.check == "mass"]
    assert note.severity == "note" and "l_hand_index_0" in note.what
