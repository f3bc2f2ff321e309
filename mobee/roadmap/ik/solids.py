"""A model of a robot's solids alone: what fields feel costs time, and no pose is refused for it."""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from mobee.model import Model
from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Robot

_KNOWN: WeakKeyDictionary[Model, Model] = WeakKeyDictionary()


def solid_model(model: Model) -> Model:
    """The model without fields, in the same world; the same as before for the same model."""
    known = _KNOWN.get(model)
    if known is None:
        known = _KNOWN[model] = Model(solid_robot(model.robot), model.world)
    known.reaching = model.reaching
    return known


@per_robot
def solid_robot(robot: Robot) -> Robot:
    """The robot without its fields."""
    kept = [index for index, shape in enumerate(robot.shapes) if shape.role == "solid"]
    number = {index: k for k, index in enumerate(kept)}
    pairs = [(number[int(a)], number[int(b)]) for a, b in robot.solid_pairs]
    return replace(
        robot,
        shapes=tuple(robot.shapes[index] for index in kept),
        solid_pairs=np.array(pairs, dtype=np.intp).reshape(-1, 2),
        field_pairs=np.empty((0, 2), dtype=np.intp),
        base_shapes=frozenset(number[index] for index in robot.base_shapes if index in number),
    )
