# SPDX-License-Identifier: Apache-2.0
"""A coarse grid on a horizontal surface: the cells in which an object may stand."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue

MARGIN = 0.01  # m: a place seen by the calibrated cameras is wrong by 2 mm (median) and 7 mm (95 %)


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
        low, high = np.array([x, y], dtype=np.float64).T
        if not (np.isfinite([low, high]).all() and (low < high).all()):
            raise InvalidValue(f"x={x!r}, y={y!r}: give lowest and highest value of each, in m.")
        if len(shape) != 2 or any(isinstance(one, bool) or not isinstance(one, int) or one < 1 for one in shape) or max(shape) < 2:
            raise InvalidValue(f"shape={shape!r}: give the number of cells along x and along y, two cells or more in total.")
        self.shape: tuple[int, int] = (shape[0], shape[1])
        self._low, self._size = low, (high - low) / np.array(shape)
        if not 0.0 <= margin < 0.5 * self._size.min():
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
