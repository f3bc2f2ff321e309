# SPDX-License-Identifier: Apache-2.0
"""An arm without a fault, and functions that add faults."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mobee.check import Finding, check_robot
from mobee.robot.load import load_robot
from mobee.robot.robot import Joint, Motor, Robot
from tests.mobee.robot.robot_files import robot_file

ARM = """\
<bodypart name="arm">
 <link z="0.2" radius="0.03" field="0.05">
  <motor name="pan" minPos="-90" maxPos="90" home="0">
   <joint name="pan" z="1">
    <link name="upper" x="-0.2" radius="0.02" field="0.06">
     <motor name="bend" minPos="10" maxPos="100" home="30">
      <joint name="bend" y="-1">
       <link name="fore" x="-0.2" radius="0.02" field="0.06">
        <link><marker name="tip" nx="-1"/></link>
       </link>
      </joint>
     </motor>
    </link>
   </joint>
  </motor>
 </link>
</bodypart>"""
LINE = {"upper": 6, "fore": 9, "tip": 10, "pan": 4, "bend": 7}  # in the file

SLIDE = (('minPos="10" maxPos="100" home="30"', 'unit="m" minPos="0" maxPos="0.2" home="0.1"'), ('y="-1"', 'type="prismatic" y="-1"'))


def arm(folder: Path, *changes: tuple[str, str]) -> Robot:
    """The arm, with texts replaced; each must be there."""
    text = ARM
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return load_robot(robot_file(folder, *text.splitlines()))


def named(robot: Robot, check: str) -> list[Finding]:
    """What one check finds in a robot; every other finding must be a note."""
    found = check_robot(robot)
    assert [finding for finding in found if finding.check != check and finding.severity != "note"] == []
    return [finding for finding in found if finding.check == check]


def with_joint(robot: Robot, name: str, **changes: object) -> Robot:
    joints = tuple(replace(joint, **changes) if joint.name == name else joint for joint in robot.joints)
    assert all(isinstance(joint, Joint) for joint in joints)
    return replace(robot, joints=joints)


def with_motor(robot: Robot, name: str, **changes: object) -> Robot:
    motors = tuple(replace(motor, **changes) if motor.name == name else motor for motor in robot.motor_table)
    assert all(isinstance(motor, Motor) for motor in motors)
    return replace(robot, motor_table=motors)
