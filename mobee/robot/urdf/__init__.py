# SPDX-License-Identifier: Apache-2.0
"""Reads robots from URDF and SRDF files."""

from mobee.robot.urdf.read import UrdfOptions, read_urdf

__all__ = ["UrdfOptions", "read_urdf"]
