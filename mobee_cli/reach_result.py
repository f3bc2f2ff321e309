# SPDX-License-Identifier: Apache-2.0
"""The result of a reach, as text and as JSON."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.reach import ReachOutcome, ReachTarget
from mobee.roadmap.ik.solve import Nearest

REACHED_DISTANCE = 0.02  # m from the target's surface, within which the target is reached
_COLUMNS = 80


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Result:
    """The result of a reach.

    `part`, `marker`: names of the part that moved and of the marker that it brought to the target. `why`: how they were chosen; empty if
    the user gave them. `target`: the target. `outcome`: outcome of the reach, as the plant reports it. `nearest`: the posture that brings
    the marker nearest to the target, if contacts are ignored. `reward`: reward of the reach. `first_motion`: time from the request to the
    first command that moves the robot [s]; None offline, or without such a command. `angle`: angle [rad] between the marker's normal and
    the direction to the target at the end; None if the marker need not face the target. `path`: states of the agent before the reach, from
    its first state to the one in which the reach began; empty without an agent. `avoided`: transitions (state, goal) that were expected to
    fail. `expected`: the reward that the agent expected; None without an agent.
    """

    part: str
    marker: str
    why: str
    target: ReachTarget
    outcome: ReachOutcome
    nearest: Nearest
    reward: float
    first_motion: float | None
    angle: float | None = None
    path: tuple[int, ...] = ()
    avoided: tuple[tuple[int, int], ...] = ()
    expected: float | None = None

    @property
    def error(self) -> float:
        """The distance of the marker from the target's surface at the end [m]; 0 if it is inside the target."""
        return max(float(np.linalg.norm(self.target.position - self.outcome.marker)) - self.target.radius, 0.0)

    @property
    def reached(self) -> bool:
        """Whether the marker ended at most 2 cm from the target's surface, or inside the target."""
        return self.error <= REACHED_DISTANCE

    @property
    def beyond(self) -> float:
        """The distance from the target's surface to the nearest position that the marker can reach [m]; 0 if that is inside the target."""
        return max(self.nearest.distance - self.target.radius, 0.0)

    def as_json(self) -> dict[str, Any]:
        """Return the result as plain JSON data. Lengths are in m, angles in rad, times in s.

        "error": distance of the marker at the end from the centre or from the surface of the target, as the target's `aim` says.
        "from_surface": its distance from the surface, 0 inside. "position": position of the marker at the end. "nearest": position nearest
        to the target that the marker can reach, and its distance from the target's centre. "expected_reward": the attribute `expected`.
        "settled", "touched" and "duration" are explained at `ReachOutcome`. The other keys are the attributes of this class with these
        names.
        """
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
            "angle": self.angle,
            "settled": outcome.settled,
            "touched": list(outcome.touched),
            "duration": outcome.duration,
            "first_motion": self.first_motion,
        }


def lines(result: Result) -> list[str]:
    """Return the result as lines of text, at most 80 columns wide."""
    outcome, aim = result.outcome, result.target.aim
    verdict = "reached" if result.reached else "did not reach"
    chosen = [f"Reaching with {result.marker}, moved by part {result.part}: {result.why}."] if result.why else []
    text = [
        *chosen,
        f"{result.marker} {verdict} the target at {_place(result.target.position)}: {1e3 * outcome.missing:.0f} mm from its {aim}, "
        f"at {_place(outcome.marker)}, after {outcome.duration:.1f} s{'' if outcome.settled else ', still moving'}.",
    ]
    if result.angle is not None:
        text.append(f"Its normal is turned {np.rad2deg(result.angle):.0f} deg away from the target.")
    if not result.reached:
        text.append(_why(result))
    if result.path:
        states = " -> ".join(map(str, result.path))
        text.append(
            f"Path: states {states}, then the reach." if len(result.path) > 1 else f"The robot was already in the best state, {states}."
        )
    if result.avoided:
        text.append(f"Avoided, expected to fail: {', '.join(f'{state} -> {goal}' for state, goal in result.avoided)}.")
    expected = "" if result.expected is None else f", {result.expected:.2f} expected"
    text.append(f"Reward {result.reward:.2f}{expected}.")
    if outcome.touched:
        text.append(f"Contacts at the end, fields included: {', '.join(outcome.touched)}.")
    if result.first_motion is not None:
        text.append(f"The first command that moves was sent {1e3 * result.first_motion:.1f} ms after the request.")
    return [line for one in text for line in textwrap.wrap(one, _COLUMNS, subsequent_indent="  ", break_on_hyphens=False)]


def _why(result: Result) -> str:
    if result.beyond == 0.0:
        learn = "" if result.path else "; a run that has learned to reach may know it (--run)"
        return f"Part {result.part} can reach this far: another posture, or a path without contacts, may succeed{learn}."
    far = f"{1e3 * result.beyond:.0f} mm from its surface if no obstacle is in between"
    place = " ".join(f"{x:.3f}" for x in result.nearest.position)
    return (
        f"The target is out of reach of {result.part}: the nearest position that {result.marker} can come to is {place}, {far}. "
        "Move the target nearer, or give a position with --target X Y Z."
    )


def _place(position: Array) -> str:
    return f"({', '.join(f'{x:.3f}' for x in position)})"
