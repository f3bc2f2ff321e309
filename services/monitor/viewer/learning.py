# SPDX-License-Identifier: Apache-2.0
"""Draws the learning of agents: the state space with its uncertain actions, and bar charts of rewards, values and tries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr

from bus_schema.messages import Learned, Transition
from mobee.arrays import Array, Ints
from mobee.learning.lattice import plane_layout
from mobee.learning.space import Space
from mobee.rendering import palette
from mobee.rendering.palette import Rgba
from mobee.robot.robot import Robot
from services.monitor.story.knowledge import numbers_of
from services.monitor.story.places import space_of
from services.monitor.viewer.frames import Frames

CERTAIN = (92, 98, 110, 110)  # colour of an action that has always reached its goal
MIN_WIDTH, MAX_WIDTH = 0.012, 0.06  # of arrows, in steps of the lattice
MIN_RADIUS, MAX_RADIUS = 0.06, 0.16  # of states, in steps of the lattice
ARROW_GAP = 0.12  # between an arrow's ends and the centres of its states
MAX_DRAWN = 65_536  # state-actions; more could not be distinguished, and drawing them would take all of the monitor's time
QUANTITIES = ("tries", "reward", "value")


@dataclass(frozen=True, eq=False)
class Drawn:
    """The drawing of an agent's state space.

    `places`: position of each state in the plane, (S, 2). `exists`: (S, A), True where the state has the action.
    """

    space: Space
    places: Array
    exists: Array


class Learning:
    """Logs the learning of agents to a Rerun stream, on entities below learning/."""

    def __init__(self, stream: rr.RecordingStream | Frames, robot: Robot) -> None:
        self._stream, self._robot = stream, robot
        self._colors = palette.colors_of_all(robot.parts)
        self._drawn: dict[str, Drawn | None] = {}
        self._made_from: dict[str, str] = {}

    def log(self, part: str, learned: Learned) -> None:
        """Log the knowledge of the agent of a part: its state space with arrows for its actions, and bar charts of all state-actions.

        A space with more than MAX_DRAWN (65 536) state-actions is not drawn; an event reports this once.
        """
        if len(learned.tries) > 4 * MAX_DRAWN:
            self._leave_out(part, learned)
            return
        drawn = self._space(part, learned.space)
        if drawn is None:
            return
        shape = drawn.space.goals.shape
        numbers = numbers_of(learned, shape)
        if numbers is None:
            return
        tries, reward, value = numbers
        path, color = f"learning/{part}", self._colors[part]
        for name, bars in zip(QUANTITIES, numbers, strict=True):
            self._stream.log(f"{path}/{name}", rr.BarChart(bars[drawn.exists].astype(np.float32), color=color))
        surprising = np.zeros(shape, dtype=bool)
        found = [one for one in learned.surprises if one.s < shape[0] and one.a < shape[1] and one.s_next < shape[0]]
        for one in found:
            surprising[one.s, one.a] = True
        states, actions = np.nonzero((tries > 0) & ~surprising)
        self._arrows(f"{path}/space/sound", drawn, states, drawn.space.goals[states, actions], MIN_WIDTH, CERTAIN)
        self._log_surprises(f"{path}/space/surprising", drawn, [(one.s, one.a, one.s_next, one.share) for one in found])
        best = np.where(drawn.exists, value, -np.inf).max(axis=1)
        self._log_states(f"{path}/space/states", drawn, best, learned.s)

    def log_step(self, part: str, seen: Transition) -> None:
        """Log the newest transition of the agent of a part as two arrows: from its state to its goal, and from its state to its outcome."""
        drawn = self._drawn.get(part)
        if drawn is None or max(seen.s, seen.goal, seen.s_next) >= len(drawn.places):
            return
        color = (*self._colors[part], 255)
        ends = np.array([seen.goal, seen.s_next])
        self._arrows(f"learning/{part}/space/newest", drawn, np.array([seen.s, seen.s]), ends, MAX_WIDTH, [(255, 255, 255, 120), color])

    def _space(self, part: str, settings: str) -> Drawn | None:
        if self._made_from.get(part) != settings:
            self._made_from[part] = settings
            space = space_of(settings, self._robot)
            self._drawn[part] = None if space is None else Drawn(space, plane_layout(space) * (1.0, -1.0), np.asarray(space.goals >= 0))
        return self._drawn[part]

    def _leave_out(self, part: str, learned: Learned) -> None:
        """Report, once, that a space is not drawn."""
        if self._made_from.get(part) != learned.space:
            self._made_from[part], self._drawn[part] = learned.space, None
            text = f"{part}: what it learns is not drawn, because its space has more than {MAX_DRAWN} state-actions"
            self._stream.log("events", rr.TextLog(text, level="INFO"))

    def _log_states(self, path: str, drawn: Drawn, best: Array, here: int) -> None:
        """Log the states, larger with larger value; the agent's present state is white."""
        span = np.ptp(best)
        radii = MIN_RADIUS + (MAX_RADIUS - MIN_RADIUS) * ((best - best.min()) / span if span > 0.0 else np.zeros(len(best)))
        colors = [(255, 255, 255) if state == here else (150, 160, 176) for state in range(len(best))]
        self._stream.log(path, rr.Points2D(drawn.places, radii=radii, colors=colors))

    def _log_surprises(self, path: str, drawn: Drawn, found: list[tuple[int, int, int, float]]) -> None:
        """Log the surprises (outcomes of an action in another state than its goal) as arrows, in one colour per state-action.

        `found`: state, action, next state and probability of each, all by number; the width of the arrow grows with the probability. The
        picture follows figure 7 of the article in Frontiers in Neurorobotics 7:25 (2014).
        """
        colors = [(*palette.JOINTS[(7 * s + a) % len(palette.JOINTS)], 255) for s, a, _, _ in found]
        widths = [MIN_WIDTH + (MAX_WIDTH - MIN_WIDTH) * share for *_, share in found]
        states, ends = (np.array([one[k] for one in found], dtype=np.intp) for k in (0, 2))
        self._arrows(path, drawn, states, ends, widths, colors)

    def _arrows(self, path: str, drawn: Drawn, states: Ints, ends: Ints, radii: float | list[float], colors: Rgba | list[Rgba]) -> None:
        """Log arrows between states; one that stays in its state is a dot beside it."""
        start, motion = drawn.places[states], drawn.places[ends] - drawn.places[states]
        length = np.linalg.norm(motion, axis=1, keepdims=True)
        unit = np.divide(motion, length, out=np.full_like(motion, 0.7), where=length > 0.0)
        self._stream.log(
            path,
            rr.Arrows2D(
                origins=start + ARROW_GAP * unit, vectors=np.maximum(length - 2.0 * ARROW_GAP, 0.05) * unit, radii=radii, colors=colors
            ),
        )
