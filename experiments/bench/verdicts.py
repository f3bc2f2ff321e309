# SPDX-License-Identifier: Apache-2.0
"""Requirements of benchmarks, the verdict on a result, and the lines of a report that state both.

The judged numbers are ratios, sizes, counts, and times that were converted to the standard machine (timing.py).  A time as measured on
this machine is not judged.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Requirement:
    """A bound on one number of a benchmark's result.

    `name`: text for the report.  `keys`: the keys that lead to the number in the nested dicts of the result, the outermost first.
    `at_least` and `at_most`: bounds; None: no bound.  `aim`: a better value, which is printed but does not change the verdict.
    """

    name: str
    keys: tuple[str | int, ...]
    at_least: float | None = None
    at_most: float | None = None
    aim: float | None = None

    def judge(self, result: Mapping[str, Any]) -> dict[str, Any]:
        """Return a dict that states whether a result meets this requirement.  Raises KeyError if the result does not contain the number.

        Keys: "name"; "found", the number to which the requirement applies; "at_least", "at_most" and "aim", each only if it is not None;
        and "passed", whether the number is within the bounds (NaN is not).
        """
        found = self._number_in(result)
        passed = (self.at_least is None or found >= self.at_least) and (self.at_most is None or found <= self.at_most)
        bounds = {"at_least": self.at_least, "at_most": self.at_most, "aim": self.aim}
        return {"name": self.name, "found": found, **{key: at for key, at in bounds.items() if at is not None}, "passed": passed}

    def is_measured(self, result: Mapping[str, Any]) -> bool:
        """Whether the result contains the number to which this requirement applies."""
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


def verdict(result: Mapping[str, Any], requirements: Iterable[Requirement], **conditions: bool) -> dict[str, Any]:
    """Return the verdict on a result, to be merged into the result.

    `conditions`: further conditions by name, each true or false.  Keys: "requirements", a list with the dict of each judged requirement, as
    `Requirement.judge` returns it; the names of the `conditions`, with their values; "passed", whether all requirements are met and all
    conditions are true.
    """
    judged = [one.judge(result) for one in requirements]
    return {"requirements": judged, **conditions, "passed": all(one["passed"] for one in judged) and all(conditions.values())}


def requirement_lines(requirements: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a line of text for each judged requirement, of at most 80 columns, that ends with the verdict ("pass" or "SHORT")."""
    return [
        f"  {one['name']:<44}{_number(one['found']):>9} {_bound(one):>8} {_aim(one):<9} {'pass' if one['passed'] else 'SHORT'}"
        for one in requirements
    ]


def report_text(lines: Iterable[str], result: Mapping[str, Any], speed: float | None = None) -> str:
    """Return the text of a benchmark's report.

    It has `lines`, then the speed of this machine if it was measured, then the requirements in `result`.  The speed is the value of "speed"
    in `result`, or else the argument `speed`.  It is a multiple of the speed of the standard machine, for which the requirements were set.
    """
    speed = result.get("speed", speed)
    calibration = [] if speed is None else [f"Calibration: {speed:.2f} x the standard machine's speed.  Required, in its time:"]
    return "\n".join([*lines, *calibration, *requirement_lines(result["requirements"])])


def _number(value: float) -> str:
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"


def _bound(one: Mapping[str, Any]) -> str:
    return f">= {_number(one['at_least'])}" if "at_least" in one else f"<= {_number(one['at_most'])}"


def _aim(one: Mapping[str, Any]) -> str:
    return f"aim {one['aim']:g}" if "aim" in one else ""
