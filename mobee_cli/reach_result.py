"""Prints the result of a reach."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.reach import ReachOutcome, ReachTarget
from mobee.roadmap.reachable import Nearest

ON = 0.02  # m from the target's surface: the hand is on it
_COLUMNS = 80


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Result:
    """How a reach went.

    `why`: how marker and part were chosen, "" where they were given.
    `path`: the states that it led through; none without a run.  `avoided`: state-actions that were expected to fail, as pairs of a
    state and the state aimed at.  `expected`: reward, None without a run.  `first_motion`: s from the request to the first command
    that moves, None offline.
    """

    part: str
    marker: str
    why: str
    target: ReachTarget
    outcome: ReachOutcome
    nearest: Nearest
    reward: float
    first_motion: float | None
    path: tuple[int, ...] = ()
    avoided: tuple[tuple[int, int], ...] = ()
    expected: float | None = None

    @property
    def error(self) -> float:
        """How far from the target's surface the marker ended, in m; 0 within it."""
        return max(float(np.linalg.norm(self.target.position - self.outcome.marker)) - self.target.radius, 0.0)

    @property
    def reached(self) -> bool:
        """Whether the marker is on the target."""
        return self.error <= ON

    @property
    def beyond(self) -> float:
        """How far from the target's surface the nearest place is to which the marker can be brought, in m."""
        return max(self.nearest.distance - self.target.radius, 0.0)

    def as_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        outcome = self.outcome
        return {
            "reached": self.reached,
            "error": outcome.missing,
            "from_surface": self.error,
            "part": self.part,
            "marker": self.marker,
            "target": {"position": self.target.position.tolist(), "radius": self.target.radius, "aim": self.target.aim},
            "position": outcome.marker.tolist(),
            "nearest": {"position": self.nearest.position.tolist(), "distance": self.nearest.distance},
            "path": list(self.path),
            "avoided": [{"state": state, "goal": goal} for state, goal in self.avoided],
            "expected_reward": self.expected,
            "reward": self.reward,
            "settled": outcome.settled,
            "touched": list(outcome.touched),
            "duration": outcome.duration,
            "first_motion": self.first_motion,
        }


def lines(result: Result) -> list[str]:
    """For a person, at most 80 columns wide."""
    outcome, aim = result.outcome, result.target.aim
    verdict = "is on" if result.reached else "did not come to"
    chosen = [f"Reaching with {result.marker}, moved by part {result.part}: {result.why}."] if result.why else []
    told = [
        *chosen,
        f"{result.marker} {verdict} the target at {_place(result.target.position)}: {1e3 * outcome.missing:.0f} mm from its {aim}, "
        f"at {_place(outcome.marker)}, after {outcome.duration:.1f} s{'' if outcome.settled else ', still moving'}.",
    ]
    if not result.reached:
        told.append(_why(result))
    if result.path:
        states = " -> ".join(map(str, result.path))
        told.append(f"Path: states {states}, then the reach." if len(result.path) > 1 else f"It was in the best state already, {states}.")
    if result.avoided:
        told.append(f"Avoided, expected to fail: {', '.join(f'{state} -> {goal}' for state, goal in result.avoided)}.")
    expected = "" if result.expected is None else f", {result.expected:.2f} expected"
    told.append(f"Reward {result.reward:.2f}{expected}.")
    if outcome.touched:
        told.append(f"Touched, fields included: {', '.join(outcome.touched)}.")
    if result.first_motion is not None:
        told.append(f"The first command that moves came {1e3 * result.first_motion:.1f} ms after the request.")
    return [line for text in told for line in textwrap.wrap(text, _COLUMNS, subsequent_indent="  ", break_on_hyphens=False)]


def _why(result: Result) -> str:
    if result.beyond == 0.0:
        learn = "" if result.path else ", as one that has learned to reach knows (--run)"
        return f"Part {result.part} is long enough: from another posture, or past what it touched, it may come there{learn}."
    far = f"{1e3 * result.beyond:.0f} mm from the target's surface"
    return f"The nearest that part {result.part} can bring it is {_place(result.nearest.position)}, {far}, if nothing is in the way."


def _place(position: Array) -> str:
    return f"({', '.join(f'{x:.3f}' for x in position)})"
