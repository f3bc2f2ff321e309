"""What a link of the iCub carries: mass, solids, fields, markers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from experiments.robots.icub_fields import HEAD, LEFT_ARM, TRUNK, Field
from experiments.robots.icub_solids import BOXES
from experiments.robots.xml_writer import box_turn, element, number, vector
from mobee.arrays import Array
from mobee.robot.bodies import to_six


def add_mass(parent: ET.Element, joint: dict[str, Any], point: Array) -> None:
    """What moves with a joint, relative to a point.

    Fingers and eyes are left out: 0.01 kg each and 0.001 kg m^2 are placeholders of the source, in whose other model hand and head
    weigh the same without them; that is the one which is simulated.
    """
    if "_hand_" in joint["name"] or "eye" in joint["name"]:
        return
    place = vector("px py pz", np.array(joint["body_com_root"]) - point)
    inertia = " ".join(number(value, 9) for value in to_six(np.array(joint["body_inertia_com_root_axes"])))
    element(parent, "mass", value=joint["body_mass_kg"], **place, inertia=inertia)


def add_shapes(parent: ET.Element, model: dict[str, Any], link: str, point: Array) -> None:
    """The solids of a link, relative to a point."""
    for index, (low, high) in enumerate(np.array(BOXES.get(link, ())).reshape(-1, 2, 3)):
        width, height, depth = high - low
        place = vector("px py pz", (low + high) / 2 - point)
        element(parent, "box", name=f"{link}_{index}", width=width, height=height, depth=depth, **place)
    for shape in model["primitives"]:
        if shape["link"] != link or link in BOXES:
            continue
        place = vector("px py pz", np.array(shape["center"]) - point)
        if shape["shape"] == "sphere":
            element(parent, "sphere", name=shape["name"], radius=shape["radius"], **place)
        elif shape["shape"] == "cylinder":
            turn = vector("hx hy hz", np.array(shape["axis"]))
            element(parent, "cylinder", name=shape["name"], radius=shape["radius"], height=shape["height"], **place, **turn)
        else:
            width, height, depth = shape["size"]
            turn = box_turn(np.array(shape["R"]))
            element(parent, "box", name=shape["name"], width=width, height=height, depth=depth, **place, **turn)


def add_fields(parent: ET.Element, link: str, point: Array) -> None:
    """The fields of a link, relative to a point."""
    for name, host, radius, first, second in fields():
        if host != link:
            continue
        ends = np.array([first, second])
        place = vector("px py pz", ends.mean(axis=0) - point)
        span = ends[1] - ends[0]
        if span.any():
            height = float(np.linalg.norm(span))
            turn = vector("hx hy hz", span / height)
            element(parent, "capsule", name=name, radius=radius, height=height, field="true", **place, **turn)
        else:
            element(parent, "sphere", name=name, radius=radius, field="true", **place)


def fields() -> list[Field]:
    """All fields, with link names in full."""
    mirror = [(n, k, r, (a[0], -a[1], a[2]), (b[0], -b[1], b[2])) for n, k, r, a, b in LEFT_ARM]
    arms = [(f"l_{n}", f"l_{k}", r, a, b) for n, k, r, a, b in LEFT_ARM] + [(f"r_{n}", f"r_{k}", r, a, b) for n, k, r, a, b in mirror]
    return TRUNK + HEAD + arms


def add_markers(parent: ET.Element, data: dict[str, Any], link: str, point: Array) -> None:
    """The markers of a link, relative to a point."""
    model = data["models"]["icub_v2_5"]
    palms = model["end_effector_zero_root"]
    for side, sign in (("left", -1.0), ("right", 1.0)):
        if link == f"{side[0]}_hand":
            rotation = np.array(palms[side]["R"])
            add_marker(parent, f"{side}_palm", np.array(palms[side]["p"]) - point, rotation, sign * rotation[:, 2])
        if link == f"{side[0]}_elbow_1":
            add_marker(parent, f"{side}_elbow", np.zeros(3), np.eye(3), np.array([1.0, 0.0, 0.0]))
        if link == f"{side[0]}_eye":
            add_marker(parent, f"{side}_eye", np.zeros(3), np.eye(3), np.array([-1.0, 0.0, 0.0]))
    if link == "head":
        head = model["head_zero_root"]
        add_marker(parent, "head", np.array(head["p"]) - point, np.array(head["R"]), np.array([-1.0, 0.0, 0.0]))


def add_marker(parent: ET.Element, name: str, place: Array, rotation: Array, normal: Array) -> None:
    """One marker."""
    rows = " ".join(number(value) for value in rotation.ravel())
    element(parent, "marker", name=name, rotation=rows, **vector("px py pz", place), **vector("nx ny nz", normal))
