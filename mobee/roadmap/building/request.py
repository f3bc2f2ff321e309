"""What was asked for when a map was built, as plain JSON: the settings of a Roadmap."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from mobee.model import Model
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.roadmap import digests
from mobee.robot.robot import Array

_PROBES, _DIGITS = 8, 9  # poses by which costs and coordinates are known again, and digits that count


def request(model: Model, problem: Problem, task: Task, spacing: Array, others: Mapping[str, Any]) -> dict[str, Any]:
    """All that decides what the map will be."""
    return {
        **digests(model),
        "reaching": model.reaching,
        "costs": list(problem.by_name),
        "names": list(task.names),
        "units": [one.unit for one in task.coordinates],
        "box": task.box.tolist(),
        "spacing": spacing.tolist(),
        "motors": [model.robot.motors[k] for k in problem.free],
        "start": problem.start.tolist(),
        "meaning": _meaning(problem, task),
        **others,
    }


def digest(asked: Mapping[str, Any]) -> str:
    """16 hex digits of a request."""
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]


def _meaning(problem: Problem, task: Task) -> str:
    """16 hex digits of what costs and coordinates say of some poses: functions have no other content that could be compared."""
    low, high = problem.limits.T
    drawn = np.random.default_rng(0).uniform(low, high, (_PROBES, len(low)))
    pose = problem.model.evaluate(np.concatenate([problem.start[None], problem.whole(drawn)]))
    said = [one.weight * one.residual(pose) for one in problem.terms] + [task.of(pose).ravel()]
    tolerances = [(one.weight, one.tolerance) for one in problem.terms]
    numbers = [f"{value:.{_DIGITS - 1}e}" for value in np.concatenate(said) + 0.0]
    return hashlib.sha256(json.dumps([tolerances, numbers]).encode()).hexdigest()[:16]
