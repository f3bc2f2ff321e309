# SPDX-License-Identifier: Apache-2.0
"""Reports the faults of a robot or world file, and their remedies."""

from mobee.check.interface import Finding
from mobee.check.run import check_file, check_robot
from mobee.check.touching import UntestedGroup, untested_groups

__all__ = ["Finding", "UntestedGroup", "check_file", "check_robot", "untested_groups"]
