# SPDX-License-Identifier: Apache-2.0
"""Functions that both writers of robot files use: they format numbers, add XML elements, and compute the orientation attributes of boxes.

The file format is described in mobee/robot/robots/README.md.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from mobee.arrays import Array
from mobee.robot.xml.node import write_tree
from mobee.robot.xml.volume import Y, angle_about, height_and_angle


def number(value: float, digits: int = 7) -> str:
    """Return a number as the shortest text with at most `digits` decimals."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def element(parent: ET.Element, tag: str, **attributes: str | float) -> ET.Element:
    """Add a child element with this tag and these attributes to `parent`, and return it; numbers become text."""
    texts = {name: value if isinstance(value, str) else number(value) for name, value in attributes.items()}
    return ET.SubElement(parent, tag, texts)


def vector(names: str, values: Array, digits: int = 7) -> dict[str, str]:
    """Return XML attributes with the components of a vector that are not zero, by name.

    `names`: names of the components, separated by spaces, as "px py pz".  `values`: the components.  `digits`: largest number of decimals.
    """
    texts = {name: number(value, digits) for name, value in zip(names.split(), values, strict=True)}
    return {name: text for name, text in texts.items() if text != "0"}


def box_turn(rotation: Array) -> dict[str, str]:
    """Return the XML attributes of a box with the orientation `rotation` (3, 3), root frame: hx, hy, hz (height axis) and angle [deg].

    Attributes with the default value are left out.
    """
    left, _, right = np.linalg.svd(rotation)
    exact = left @ right
    axis, _ = height_and_angle(exact)
    turn = {} if np.allclose(axis, Y, atol=1e-7) else vector("hx hy hz", axis)
    written = np.array([float(turn.get(name, 0.0)) for name in ("hx", "hy", "hz")]) if turn else Y
    if exact[1, 1] * axis[1] < 0:
        exact = exact * np.array([1.0, -1.0, -1.0])  # the same box
    angle = np.rad2deg(angle_about(written / np.linalg.norm(written), exact))
    return turn if abs(angle) < 1e-5 else turn | {"angle": number(float(angle), 6)}


def write(root: ET.Element, path: Path, heading: str) -> None:
    """Write the XML tree indented to a file, with the comment `heading`, which states its origin."""
    write_tree(root, path, heading)
