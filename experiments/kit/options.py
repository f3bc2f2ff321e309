"""Types of command line options that more than one experiment takes."""

from __future__ import annotations

import argparse
import math


def positive_whole(text: str) -> int:
    """A whole number of 1 or more."""
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive whole number")
    return int(text)


def whole_from_two(text: str) -> int:
    """A whole number of 2 or more."""
    number = positive_whole(text)
    if number < 2:
        raise argparse.ArgumentTypeError(f"{text!r} is less than 2")
    return number


def positive_number(text: str) -> float:
    """A finite number above 0."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number")
    return number
