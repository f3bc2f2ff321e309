# SPDX-License-Identifier: Apache-2.0
"""States that include the position of an object: the posture of a part, and the cell of a grid in which the object is perceived."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Ints
from mobee.errors import InvalidValue, MobeeError
from mobee.learning.grid import Grid
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import MAX_STATES, Space
from mobee.plant import Outcome


class ObjectSpace(Space):
    """A space whose states are pairs of a posture and a cell of an object: state = posture + postures * cell.

    The actions of a state are those of its posture. The goal of an action has the same cell, so a learner is surprised if an action moves
    the object. Agents, explorers and planners use this space as any other. The plant must perceive the object: use `PerceivingPlant`, or
    another plant with `perceive`. While the object is not perceived, the space assumes that it is still in its last cell.

    Args:
        postures: the states and actions of the part.
        grid: the cells in which the object may be.
        name: name of the object, under which the plant perceives it.

    Raises:
        InvalidValue: there are too many states; the message states the largest number.
    """

    def __init__(self, postures: Space, grid: Grid, name: str) -> None:
        count = len(postures) * len(grid)
        if count > MAX_STATES:
            raise InvalidValue(f"{len(postures)} postures x {len(grid)} cells make {count} states; the limit is {MAX_STATES}.")
        first = len(postures) * np.arange(len(grid))[:, None, None]  # state of the first posture in each cell
        goals = np.where(postures.goals == NO_ACTION, NO_ACTION, postures.goals + first).reshape(count, -1)
        super().__init__(postures.robot, postures.joints, np.tile(postures.samples, (len(grid), 1)), goals, postures.rest)
        self.postures, self.grid, self.name = postures, grid, name
        self.cells: Ints = np.repeat(np.arange(len(grid)), len(postures))
        """The cell of each state, shape (S,)."""
        self.cells.flags.writeable = False

    def __repr__(self) -> str:
        return f"<ObjectSpace of {self.part} and {self.name}: {len(self.postures)} postures x {len(self.grid)} cells>"

    def state(self, posture: int, cell: int) -> int:
        """Return the number of the state with a posture and a cell; raises InvalidValue if there is no such posture or cell."""
        self.postures.target(posture)
        self.grid.centre(cell)
        return posture + len(self.postures) * cell

    def posture(self, state: int) -> int:
        """Return the posture of a state: its number in `postures`."""
        return self._checked_state(state) % len(self.postures)

    def cell(self, state: int) -> int:
        """Return the cell of the object in a state: its number in `grid`."""
        return self._checked_state(state) // len(self.postures)

    def in_cell(self, cell: int) -> Ints:
        """Return all states with the object in this cell, ascending. They can be the goal of an agent, or the targets of a planner."""
        return self.state(0, cell) + np.arange(len(self.postures))

    def state_after(self, outcome: Outcome, before: int | None = None) -> int:
        """Return the state in which an action ended: the posture by the encoders, and the cell in which the object was perceived.

        `before`: the state in which the action began; its cell is used if the object was not perceived. None: not known; then raises
        MobeeError if the object was not perceived.
        """
        known = None if before is None else self.cell(before)
        place = outcome.perceived.get(self.name)
        if place is None and known is None:
            raise MobeeError(
                f"the place of {self.name} is not known: the plant perceives {', '.join(outcome.perceived) or 'no object'}. "
                "Give the agent a PerceivingPlant, and begin when the object is perceived."
            )
        cell = known if place is None else self.grid.cell_of(place, known)
        return self.state(self.postures.state_of(outcome.q), 0 if cell is None else cell)

    def state_of(self, q: ArrayLike) -> int:
        """Raise InvalidValue, because a pose alone does not determine a state of this space; use `state_after` or `state`."""
        raise InvalidValue(
            f"a state of {self.part} holds the cell of {self.name} too, so that no pose is a state: give the number of a state, "
            f"posture + {len(self.postures)} x cell, or use state_after(outcome)."
        )

    def state_of_joints(self, q: ArrayLike) -> int:
        """Raise InvalidValue, because a pose alone does not determine a state of this space; use `state_after` or `state`."""
        return self.state_of(q)

    @property
    def settings(self) -> dict[str, Any]:
        """Postures, grid and name of the object, and a hash of the space, as JSON values.

        `mobee.learning.record.space_from` rebuilds the space from them.
        """
        return self._made | {"kind": "object", "object": self.name, "postures": self.postures.settings, "grid": self.grid.settings}
