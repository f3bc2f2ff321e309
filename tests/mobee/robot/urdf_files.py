# SPDX-License-Identifier: Apache-2.0
"""URDF files for tests, written line by line so that a message's line number can be checked, and those of other makers."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np

from mobee.arrays import Array

HEAD = '<robot name="toy">'
LINKS = '<link name="base"/><link name="upper"/><link name="lower"/>'
ARM = (
    LINKS,
    '<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>',
    ' <limit lower="-1" upper="2" velocity="3" effort="4"/></joint>',
    '<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="1 0 0"/><axis xyz="0 1 0"/>',
    ' <limit lower="-2" upper="2" velocity="3" effort="4"/></joint>',
)


def urdf_file(folder: Path, *lines: str) -> Path:
    """A file whose `lines` start in line 2."""
    path = folder / "toy.urdf"
    path.write_text("\n".join([HEAD, *lines, "</robot>"]) + "\n", encoding="utf-8")
    return path


def arm_with(folder: Path, geometry: str, origin: str = '<origin xyz="0 0 0"/>') -> Path:
    """Two joints, and one collision element on the last link, in line 7."""
    body = f'<link name="hand"><collision name="palm">{origin}<geometry>{geometry}</geometry></collision></link>'
    wrist = '<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="1 0 0"/></joint>'
    return urdf_file(folder, *ARM, body, wrist)


def srdf_file(folder: Path, *lines: str) -> Path:
    path = folder / "toy.srdf"
    path.write_text("\n".join([HEAD, *lines, "</robot>"]) + "\n", encoding="utf-8")
    return path


def foreign(name: str) -> Path:
    """A URDF that comes with PyBullet."""
    return Path(importlib.import_module("pybullet_data").getDataPath()) / name


def write_stl(path: Path, facets: Array) -> Path:
    """A binary STL of triangles (f, 3, 3)."""
    table = np.zeros(len(facets), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table["corners"] = facets
    path.write_bytes(b"\0" * 80 + np.uint32(len(facets)).tobytes() + table.tobytes())
    return path


def tetrahedron(size: float = 0.1) -> Array:
    """Four triangles (4, 3, 3)."""
    corners = size * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
