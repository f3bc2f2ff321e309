"""Pairs of links whose solids touch at home, or in every pose: what an SRDF leaves out as MoveIt's setup assistant does."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mobee.model import Model
from mobee.robot.check.subject import SEED, Subject
from mobee.robot.robot import Array, Robot

POSES = 10_000  # random ones: a pair that touches in all of them touches in every pose that matters
CHUNK = 500  # poses evaluated at once

LinkNames = tuple[str, str]


@dataclass(frozen=True, slots=True)
class TouchingPair:
    """Two links whose solids touch; of a URDF its own links, before those of fixed joints are merged."""

    first: str
    second: str
    reason: Literal["Default", "Always"]  # at home, or in all random poses: MoveIt's words
    depth: float  # m, of the deepest contact at home; 0 where they do not touch there
    share: float  # of the random poses in which they touch


def touching_pairs(robot: Robot, poses: int = POSES) -> tuple[TouchingPair, ...]:
    """The pairs that touch at home or in all random poses, those that always touch first; a fixed seed draws the poses.

    Of a robot in which no world object is: only its own solids are looked at, fields do not count.
    """
    subject = Subject(replace(robot, field_pairs=robot.field_pairs[:0]))
    model = Model(subject.limited)
    names = {(i, j): _links(subject, i, j) for i, j in map(sorted, robot.solid_pairs.tolist())}
    depth: dict[LinkNames, float] = {}
    index = {shape.name: number for number, shape in enumerate(robot.shapes)}
    for contact in model.evaluate(subject.home).contacts:
        first, second = sorted((index[contact.first], index[contact.second]))
        pair = names[first, second]
        depth[pair] = max(depth.get(pair, 0.0), contact.depth)
    times: dict[LinkNames, int] = defaultdict(int)
    rng, (low, high) = np.random.default_rng(SEED), subject.range.T
    for start in range(0, poses, CHUNK):
        batch = rng.uniform(low, np.maximum(high, low), (min(CHUNK, poses - start), len(low)))
        for pair, count in _counted(model, batch, names).items():
            times[pair] += count
    found = [
        TouchingPair(*pair, "Always" if times[pair] == poses else "Default", depth.get(pair, 0.0), times[pair] / poses)
        for pair in {*depth, *(pair for pair, count in times.items() if count == poses)}
    ]
    return tuple(sorted(found, key=lambda pair: (pair.reason, -pair.share, pair.first, pair.second)))


def _counted(model: Model, poses: Array, names: dict[tuple[int, int], LinkNames]) -> dict[LinkNames, int]:
    """In how many of the poses (k, n) each pair of links touches."""
    numbers = model.evaluate(poses).table.numbers
    seen: dict[LinkNames, set[int]] = defaultdict(set)
    for pose, first, second in numbers[:, [0, 2, 3]].tolist():
        seen[names[min(first, second), max(first, second)]].add(pose)
    return {pair: len(touching) for pair, touching in seen.items()}


def _links(subject: Subject, first: int, second: int) -> LinkNames:
    shapes, links = subject.robot.shapes, subject.robot.links
    one, other = (subject.urdf_link(shapes[i].name) or links[shapes[i].link] for i in (first, second))
    return (one, other) if one < other else (other, one)
