# SPDX-License-Identifier: Apache-2.0
"""Reports what is wrong with a robot or world file, and what to do about it."""

from mobee.check.file import check_file
from mobee.check.finding import Finding
from mobee.check.robot import check_robot
from mobee.check.touching import UntestedGroup, untested_groups

__all__ = ["Finding", "UntestedGroup", "check_file", "check_robot", "untested_groups"]
