# SPDX-License-Identifier: Apache-2.0
"""Requirements of benchmarks, the verdict on a result, and the lines that a report prints of both.

A number that is judged is a ratio, a size or a count, or a time on the standard machine (calibration.py): never a bare time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Requirement:
    """A bound on one number of a benchmark's result; `aim` is printed and decides nothing."""

    name: str
    keys: tuple[str | int, ...]  # of the result, from the outermost
    at_least: float | None = None
    at_most: float | None = None
    aim: float | None = None

    def judge(self, result: Mapping[str, Any]) -> dict[str, Any]:
        """Return name, number, bounds and verdict, as they are in the JSON of the benchmark; raises KeyError if it was not measured."""
        return judged(self.name, self._number_in(result), at_least=self.at_least, at_most=self.at_most, aim=self.aim)

    def is_measured(self, result: Mapping[str, Any]) -> bool:
        """Whether the result has the number."""
        try:
            self._number_in(result)
        except KeyError:
            return False
        return True

    def _number_in(self, result: Mapping[str, Any]) -> float:
        found: Any = result
        for key in self.keys:
            found = found[key]
        return float(found)


def judged(
    name: str, found: float, *, at_least: float | None = None, at_most: float | None = None, aim: float | None = None
) -> dict[str, Any]:
    """Return the verdict on one number as JSON has it; `aim`: a better value, which decides nothing.  NaN never passes."""
    passed = (at_least is None or found >= at_least) and (at_most is None or found <= at_most)
    bounds = {"at_least": at_least, "at_most": at_most, "aim": aim}
    return {
        "name": name,
        "found": float(found),
        **{key: bound for key, bound in bounds.items() if bound is not None},
        "passed": bool(passed),
    }


def verdict(requirements: Sequence[Mapping[str, Any]], **conditions: bool) -> dict[str, Any]:
    """Return the part of a result that says whether it passes: every requirement is met and every named condition holds."""
    passed = all(one["passed"] for one in requirements) and all(conditions.values())
    return {"requirements": list(requirements), **conditions, "passed": passed}


def calibration_line(speed: float) -> str:
    """Return the line of a report with the speed of this machine, as a multiple of the standard machine."""
    return f"Calibration: {speed:.2f} x the standard machine's speed.  Required, in its time:"


def requirement_lines(requirements: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a line of at most 80 columns for each requirement; it ends with the verdict."""
    return [
        f"  {one['name']:<44}{_number(one['found']):>9} {_bound(one):>8} {_aim(one):<9} {'pass' if one['passed'] else 'SHORT'}"
        for one in requirements
    ]


def report_text(lines: Iterable[str], result: Mapping[str, Any]) -> str:
    """Return the lines of a benchmark, then the speed of this machine if it was measured, then the requirements."""
    speed = [calibration_line(result["speed"])] if "speed" in result else []
    return "\n".join([*lines, *speed, *requirement_lines(result["requirements"])])


def _number(value: float) -> str:
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"


def _bound(one: Mapping[str, Any]) -> str:
    return f">= {_number(one['at_least'])}" if "at_least" in one else f"<= {_number(one['at_most'])}"


def _aim(one: Mapping[str, Any]) -> str:
    return f"aim {one['aim']:g}" if "aim" in one else ""
