"""Formats numbers as text that reads back as the same numbers."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np


def number(value: float) -> str:
    """The shortest text of a number."""
    return repr(float(value)) if value % 1 or abs(value) > 1e15 else str(int(value))


def numbers(values: Iterable[float]) -> str:
    """The shortest texts of numbers, with blanks between them."""
    return " ".join(map(number, values))


def degrees(radians: float) -> str:
    """An angle in degrees, rounded where that reads back as exactly the same radians."""
    exact = float(np.rad2deg(radians))
    rounded = round(exact, 9)
    return number(rounded if np.deg2rad(rounded) == radians else exact)
