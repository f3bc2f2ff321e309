# SPDX-License-Identifier: Apache-2.0
"""Draws plots over time: motor positions and goals, forces by term, and the rewards of agents."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import rerun as rr

from bus_schema.messages import Forces, Motion, Transition
from mobee.control.forces import published_terms
from mobee.rendering import palette
from mobee.robot.robot import Robot
from services.monitor.viewer.frames import Frames

SHOWN = 4  # joints of a part: shoulder and elbow of an arm, all of the torso
LEARNED = ("reward", "value", "transitions")


class Plots:
    """Logs numbers to a Rerun stream, on entities below plots/.

    It uses few entities with many series each, because each entity makes a recording larger.
    """

    def __init__(self, stream: rr.RecordingStream | Frames, robot: Robot) -> None:
        self._stream = stream
        self._parts = parts = palette.colors_of(robot.parts)
        for part in parts:
            motors = robot.part(part).motors[:SHOWN]
            short = [motor.rsplit("_", 1)[-1] for motor in motors]  # pitch, roll, yaw, elbow
            names = short if not any(name.isdecimal() for name in short) else list(motors)
            colors = palette.JOINTS[: len(motors)]
            goals = [palette.faded(color, 0.6) for color in colors]
            widths = [1.6] * len(motors) + [0.8] * len(motors)
            self._style(f"joints/{part}", [*colors, *goals], widths, names + ["goal"] * len(motors))
        self._strengths = dict.fromkeys(published_terms(), 0.0)  # of the forces, by name
        self._style_forces()
        for quantity in LEARNED:
            for part, color in parts.items():
                self._style(f"{quantity}/{part}", [color], [1.4], [part.replace("_", " ")])

    def log_motion(self, part: str, motion: Motion) -> None:
        """Log the positions and the goal of the first four motors of a part [rad]; nothing for a part without a plot."""
        if part not in self._parts:
            return
        self._stream.log(f"plots/joints/{part}", rr.Scalars([*motion.q[:SHOWN], *motion.goal[:SHOWN]]))

    def log_forces(self, forces: Forces) -> None:
        """Log, for each term of the control law, the norm of its forces on all motors [rad/s^2]; these forces are accelerations.

        Model and controller each send some of the terms. Every call logs all terms: those in `forces`, and the newest norms of the others.
        """
        known = len(self._strengths)
        self._strengths |= {name: float(np.linalg.norm(row)) for name, row in forces.terms.items()}
        if len(self._strengths) > known:
            self._style_forces()
        self._stream.log("plots/forces", rr.Scalars(list(self._strengths.values())))

    def log_transition(self, part: str, seen: Transition) -> None:
        """Log the reward, the value of the state before the action, and the number of a transition; nothing for a part without a plot.

        The reward of a curious agent is in nats; that of a reaching agent is 0, or the penalty of a failure. The agent's
        transitions are numbered from 1 in the order of time.
        """
        if part not in self._parts:
            return
        for quantity, value in zip(LEARNED, (seen.reward, seen.value, float(seen.n)), strict=True):
            self._stream.log(f"plots/{quantity}/{part}", rr.Scalars(value))

    def _style_forces(self) -> None:
        colors = [color for color, _ in zip(cycle(palette.FORCES), self._strengths, strict=False)]
        self._style("forces", colors, [1.4] * len(colors), list(self._strengths))

    def _style(self, path: str, colors: list[palette.Color], widths: list[float], names: list[str]) -> None:
        style = rr.SeriesLines(colors=colors, widths=widths, names=names)
        self._stream.log(f"plots/{path}", style, static=True)
