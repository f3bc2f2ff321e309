# SPDX-License-Identifier: Apache-2.0
"""States that include the position of an object: the posture of a part, and the cell of a grid in which the object is perceived.

The grid lies on a horizontal surface on which the object may stand.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints, is_number, real_array
from mobee.errors import InvalidValue, MobeeError
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import MAX_STATES, Space
from mobee.plant import Outcome

MARGIN = 0.01  # m: a place seen by the calibrated cameras is wrong by 2 mm (median) and 7 mm (95 %)


class ObjectSpace(Space):
    """A space whose states are pairs of a posture and a cell of an object: state = posture + number of postures * cell.

    The actions of a state are those of its posture. The goal of an action has the same cell, so a learner is surprised if an action moves
    the object. Agents, explorers and planners use this space as any other. The plant must perceive the object: use `PerceivingPlant`, or
    another plant with `perceive`. While the object is not perceived, the space assumes that it is still in its last cell.

    Args:
        postures: the states and actions of the part.
        grid: the cells in which the object may be.
        name: name of the object, under which the plant perceives it.

    Raises:
        InvalidValue: there are too many states, and the message states the largest number; or `postures` is an `ObjectSpace`.
    """

    only_postures = False

    def __init__(self, postures: Space, grid: Grid, name: str) -> None:
        if isinstance(postures, ObjectSpace):
            raise InvalidValue(f"{postures} holds the cell of an object already: states can hold the cell of one object only.")
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


class Grid:
    """Equal rectangular cells on a horizontal surface, numbered row by row: cell = column + columns * row.

    Columns are along x and rows along y; as in a lattice, the number changes fastest along the first axis.

    Args:
        x: lowest and highest x of the grid, m in the root frame.
        y: lowest and highest y, m.
        shape: number of cells along x (columns) and along y (rows).
        margin: m. A position must be farther than this beyond the border of the present cell to count as another cell. So the cell does not
            change because of errors of perception while the object rests near a border.

    Raises:
        InvalidValue: an empty range, fewer than two cells, or a margin that is negative or half a cell or more.
    """

    def __init__(self, x: tuple[float, float], y: tuple[float, float], shape: tuple[int, int], margin: float = MARGIN) -> None:
        ranges, sizes = real_array("x and y of the grid", [x, y]), np.asarray(shape)
        if ranges.shape != (2, 2) or not (np.isfinite(ranges).all() and (ranges[:, 0] < ranges[:, 1]).all()):
            raise InvalidValue(f"x={x!r}, y={y!r}: give lowest and highest value of each, in m.")
        if sizes.shape != (2,) or sizes.dtype.kind not in "iu" or sizes.min() < 1 or sizes.max() < 2:
            raise InvalidValue(f"shape={shape!r}: give the number of cells along x and along y, two cells or more in total.")
        low, high = ranges.T
        self.shape: tuple[int, int] = (int(sizes[0]), int(sizes[1]))
        self._low, self._size = low, (high - low) / sizes
        if not (is_number(margin) and 0.0 <= margin < 0.5 * self._size.min()):
            raise InvalidValue(f"margin={margin!r} m: give 0 or more, below {0.5 * self._size.min():.4g} m, half of a cell.")
        self.margin = float(margin)
        self._range = (tuple(map(float, x)), tuple(map(float, y)))

    def __len__(self) -> int:
        return self.shape[0] * self.shape[1]

    def __repr__(self) -> str:
        return f"<Grid of {self.shape[0]} x {self.shape[1]} cells, {self._size[0]:.3g} x {self._size[1]:.3g} m each>"

    def cell_of(self, place: ArrayLike, before: int | None = None) -> int:
        """Return the cell that contains the position `place`, (2,) or (3,) m in the root frame; outside the grid, the nearest cell.

        `before`: the present cell, which is returned if the position is at most `margin` beyond its border; None: no cell is preferred.
        Raises InvalidValue for numbers that are not finite, or if there is no cell `before`.
        """
        at = real_array("place", place)
        if at.shape not in ((2,), (3,)) or not np.isfinite(at).all():
            raise InvalidValue(f"place {place!r}: give two or three finite numbers, in m.")
        within = np.clip(at[:2] - self._low, 0.0, self._size * self.shape)
        if before is not None and (np.abs(within + self._low - self.centre(before)) <= 0.5 * self._size + self.margin).all():
            return before
        column, row = np.minimum(within // self._size, np.array(self.shape) - 1).astype(int).tolist()
        cell: int = column + self.shape[0] * row
        return cell

    def centre(self, cell: int) -> Array:
        """Return the centre of a cell, (x, y) in m in the root frame; raises InvalidValue if there is no such cell."""
        if not 0 <= cell < len(self):
            raise InvalidValue(f"the grid has no cell {cell!r}: valid are 0 to {len(self) - 1}.")
        row, column = divmod(cell, self.shape[0])
        centre: Array = self._low + (np.array([column, row]) + 0.5) * self._size
        return centre

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments, as JSON values."""
        x, y = self._range
        return {"x": list(x), "y": list(y), "shape": list(self.shape), "margin": self.margin}
