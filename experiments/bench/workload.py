"""The benchmark's robot, worlds and poses: data/bench_model.json."""

from __future__ import annotations

import itertools
import json
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

import mobee
from mobee.arrays import Array
from mobee.model.world import World
from mobee.robot.robot import Joint, Motor, Part, Robot, Shape

SEED = 2014
_FILE = Path(__file__).with_name("data") / "bench_model.json"


@cache
def robot(role: Literal["field", "solid"] = "field", primitives: int | None = None) -> Robot:
    """The upper body with its first `primitives` shapes (None: all 129) as fields, so that they make forces, or as solids.

    The base's own shapes are not tested against the world: none of the two moves.
    """
    data = _data()
    joints = tuple(_joint(entry) for entry in data["joints"])
    motors = tuple(_motor(index, entry, data["joints"]) for index, entry in enumerate(data["motors"]))
    shapes = tuple(_shape(index, entry, role) for index, entry in enumerate(data["primitives"][:primitives]))
    untested = {frozenset((one + 1, other + 1)): "listed by the workload" for one, other in data["excluded_link_pairs"]}
    pairs = np.array(_pairs(shapes, set(untested)), dtype=np.intp).reshape(-1, 2)
    none = np.empty((0, 2), dtype=np.intp)
    return Robot(
        name="bench",
        links=("base", *(joint.name for joint in joints)),
        joints=joints,
        motor_table=motors,
        parts={"body": Part("body", tuple(motor.name for motor in motors), 0)},
        markers={},
        shapes=shapes,
        clauses=(),
        field_pairs=pairs if role == "field" else none,
        solid_pairs=pairs if role == "solid" else none,
        base_shapes=frozenset(index for index, shape in enumerate(shapes) if shape.link == 0),
        untested=untested,
    )


def world(boxes: int) -> World:
    """The first `boxes` (0 to 1000) of the random boxes; each number is a prefix of the next."""
    made = World()
    for index, entry in enumerate(_data()["boxes"][:boxes]):
        turn = np.array(entry["R"]).reshape(3, 3)
        made.add(f"box{index}", mobee.box(*(2.0 * half for half in entry["size"])), position=entry["pos"], rotation=turn)
    return made


def poses(count: int, seed: int = SEED) -> Array:
    """Random q (count, 41) rad, uniform between the limits."""
    low, high = robot().limits.T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


@cache
def _data() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(_FILE.read_text())
    return content


def _joint(entry: dict[str, Any]) -> Joint:
    axis = np.array(entry["axis"])
    return Joint(entry["name"], entry["parent"] + 1, "revolute", axis / np.linalg.norm(axis), np.array(entry["point"]), np.zeros(2))


def _motor(index: int, entry: dict[str, Any], joints: list[dict[str, Any]]) -> Motor:
    driven = tuple((number, joint["ratio"], 0.0) for number, joint in enumerate(joints) if joint["motor"] == index)
    return Motor(entry["name"], "body", np.array([entry["lo"], entry["hi"]]), 0.0, driven)


def _shape(index: int, entry: dict[str, Any], role: Literal["field", "solid"]) -> Shape:
    kind, given, turn = entry["type"], entry["size"], np.array(entry["R"]).reshape(3, 3)
    size = tuple(2.0 * half for half in given) if kind == "box" else (given[0], *(2.0 * half for half in given[1:]))
    return Shape(f"s{index}", entry["link"] + 1, kind, size, np.array(entry["pos"]), turn, role, "body")


def _pairs(shapes: tuple[Shape, ...], untested: set[frozenset[int]]) -> list[tuple[int, int]]:
    numbered = itertools.combinations(enumerate(shapes), 2)
    return [(i, j) for (i, a), (j, b) in numbered if a.link != b.link and frozenset((a.link, b.link)) not in untested]
