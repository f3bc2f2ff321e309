"""Which objects of the world a part of a plant touches, without a look at what the body does to itself."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mobee.collision.touch import links_moved, touched_in
from mobee.engine import engine_of
from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Array, Robot

if TYPE_CHECKING:
    from mobee.model import Model


class Touching:
    """What `touched_by` says of the model's pose, sooner."""

    __slots__ = ("_engine", "_model", "_moved")

    def __init__(self, model: Model) -> None:
        self._model, self._engine = model, engine_of(_without_pairs(model.robot))
        self._moved = links_moved(model.robot)

    def by(self, part: str, q: Array) -> tuple[str, ...]:
        """The names of the objects that a part touches at q (n,), in the world of now."""
        snapshot = self._model.world.snapshot
        if not snapshot.names:
            return ()
        return touched_in(self._engine.contacts_of_one(q.tobytes(), snapshot, self._model.hands)[0], self._moved[part])


@per_robot
def _without_pairs(robot: Robot) -> Robot:
    """The robot without contacts of its shapes with each other."""
    return replace(robot, solid_pairs=robot.solid_pairs[:0], field_pairs=robot.field_pairs[:0])
