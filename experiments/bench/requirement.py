"""What a benchmark requires: a figure, its bound and the verdict.

Figures that are judged are ratios, sizes or counts, or times on the standard machine (calibration.py): never bare times.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any


def judged(
    name: str, found: float, *, at_least: float | None = None, at_most: float | None = None, aim: float | None = None
) -> dict[str, Any]:
    """One requirement as JSON has it; `aim`: what is hoped for, which decides nothing."""
    passed = (at_least is None or found >= at_least) and (at_most is None or found <= at_most)
    bounds = {"at_least": at_least, "at_most": at_most, "aim": aim}
    return {
        "name": name,
        "found": float(found),
        **{key: bound for key, bound in bounds.items() if bound is not None},
        "passed": bool(passed),
    }


def all_passed(requirements: Iterable[Mapping[str, Any]]) -> bool:
    """Whether everything required is met."""
    return all(one["passed"] for one in requirements)


def lines(requirements: Iterable[Mapping[str, Any]]) -> list[str]:
    """A line each of at most 80 columns, that ends with its verdict."""
    return [
        f"  {one['name']:<44}{_number(one['found']):>9} {_bound(one):>8} {_aim(one):<9} {'pass' if one['passed'] else 'SHORT'}"
        for one in requirements
    ]


def _number(value: float) -> str:
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"


def _bound(one: Mapping[str, Any]) -> str:
    return f">= {_number(one['at_least'])}" if "at_least" in one else f"<= {_number(one['at_most'])}"


def _aim(one: Mapping[str, Any]) -> str:
    return f"aim {one['aim']:g}" if "aim" in one else ""
