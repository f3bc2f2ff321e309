# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

from tests.mobee.check.arm import arm, named

FORE = 'name="fore" x="-0.2" radius="0.02" field="0.06"'


def test_a_robot_without_fields_is_noted(tmp_path: Path) -> None:
    robot = arm(tmp_path, (' field="0.05"', ""), (' field="0.06"', ""))
    assert [finding.what for finding in named(robot, "field")] == ["the robot has no field"]


def test_links_without_a_field_are_counted(tmp_path: Path) -> None:
    (finding,) = named(arm(tmp_path, (FORE, FORE.removesuffix(' field="0.06"'))), "field")
    assert finding.what == "1 link with solids and without a field: bend"


def test_a_link_with_solids_of_several_parts_is_counted_once(tmp_path: Path) -> None:
    foot = ('<bodypart name="arm">', '<sphere name="foot" radius="0.01" pz="-0.3"/><bodypart name="arm">')
    (finding,) = named(arm(tmp_path, foot, ('radius="0.03" field="0.05"', 'radius="0.03"')), "field")
    assert finding.what == "1 link with solids and without a field: base"


def test_a_field_smaller_than_its_solid_is_found(tmp_path: Path) -> None:
    findings = named(arm(tmp_path, (FORE, FORE.replace("0.06", "0.015"))), "field")
    assert [finding.severity for finding in findings] == ["warning", "note"]
    assert findings[0].what == "field 'fore_field' lies inside solid 'fore'"


def test_a_solid_that_stands_out_of_its_fields_is_noted(tmp_path: Path) -> None:
    (finding,) = named(arm(tmp_path, ("<marker", '<box name="nose" width="0.1" height="0.02" depth="0.02"/><marker')), "field")
    assert finding.what == "not enclosed by the fields of link 'bend': nose by 50 mm"


def test_two_fields_enclose_together(tmp_path: Path) -> None:
    nose = '<box name="nose" width="0.1" height="0.02" depth="0.02"/><sphere name="puff" radius="0.07" field="true" px="-0.02"/><marker'
    assert named(arm(tmp_path, ("<marker", nose)), "field") == []
