"""What is wrong with a robot or a world, and what to do about it."""

from mobee.robot.check.file import check_file
from mobee.robot.check.finding import Finding
from mobee.robot.check.robot import check_robot
from mobee.robot.check.untested import UntestedGroup, untested_groups

__all__ = ["Finding", "UntestedGroup", "check_file", "check_robot", "untested_groups"]
