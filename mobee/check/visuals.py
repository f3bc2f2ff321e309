# SPDX-License-Identifier: Apache-2.0
"""Checks the visuals of a robot, its drawn surfaces: finds mesh files that do not exist."""

from __future__ import annotations

from collections.abc import Iterator

from mobee.check.finding import Finding, some
from mobee.check.subject import Subject
from mobee.robot.urdf.mesh import first_file, mesh_places, searched


def missing_meshes(subject: Subject) -> Iterator[Finding]:
    """Yield one finding if mesh files of the robot's visuals (its drawn surfaces) do not exist."""
    sources = dict.fromkeys(visual.mesh for visual in subject.robot.visuals if visual.mesh is not None)
    missing = [one for one in sources if first_file(mesh_places(one.file, one.robot_file)) is None]
    if missing:
        first = missing[0]
        yield Finding(
            "warning",
            "missing-meshes",
            f"{first.robot_file}:{first.line}",
            f"meshes that are drawn are missing: {some([repr(one.file) for one in missing])}",
            f"solids are shown instead, where nothing else is (looked at {searched(mesh_places(first.file, first.robot_file))})",
            "put the files there, correct their names, or name the folder of their package in ROS_PACKAGE_PATH",
        )
