"""What really happens in a trial: judged at the joints, without the noise of the encoders."""

from __future__ import annotations

import numpy as np

from experiments.graze.approach import MARKER, Table, Way
from mobee.control.reflex import Recovery, Reflex
from mobee.robot.robot import Array

STOPPING = 30  # ticks in which the robot comes to a stop
MORE = 1e-3  # m by which a way back must be deeper than the stop to count as such


class Truth:
    """Depths, and the course of the first recovery."""

    def __init__(self, table: Table, way: Way) -> None:
        self._track = table.model.track()
        start, end = (table.model.evaluate(way.postures[i]).position(MARKER)[:2] for i in (way.start, -1))
        length = float(np.linalg.norm(end - start))
        self._start, self._along = start, (end - start) / length if length > MORE else np.zeros(2)
        self.depth = self.solid = self.progress = 0.0
        self.flips = self.flicker = 0
        self.again = self.came_back = self.never = self.deeper = False
        self._seen = False
        self._since_first = -1  # ticks, since the encoders first saw a contact
        self._first: Recovery | None = None
        self._depths: list[float] = []  # along the first recovery
        self._is_over = False

    def look(self, q: Array, seen: bool, reflex: Reflex | None) -> None:
        """One tick: where the joints are, whether the encoders saw something wrong, and the reflex after it judged that."""
        pose = self._track.evaluate(q)
        depths = {"solid": 0.0, "field": 0.0}
        for contact in pose.contacts:
            depths[contact.kind] = max(depths[contact.kind], float(contact.depth))
        depth = max(depths.values())
        self.depth, self.solid = max(self.depth, depth), max(self.solid, depths["solid"])
        self.progress = max(self.progress, float((pose.position(MARKER)[:2] - self._start) @ self._along))
        self.flips += seen != self._seen
        self._seen = seen
        if seen or self._since_first >= 0:
            self._since_first += 1
            if not seen:
                self.flicker = self._since_first
        if reflex is not None and reflex.recovery is not None and not self._is_over:
            self._follow(reflex.recovery, depth)

    def finish(self) -> None:
        """The trial is over."""
        if not self._is_over and self._first is not None:
            self._conclude(self._first, self._depths[-1])

    def _follow(self, recovery: Recovery, depth: float) -> None:
        """The first recovery, from where control is taken to where it is given back."""
        if self._first is None:
            self._first = recovery
        self._depths.append(depth)
        if self._first.outcome != "under way":
            self._conclude(self._first, depth)

    def _conclude(self, recovery: Recovery, depth: float) -> None:
        self._is_over = True
        touching = np.array(self._depths) > 0.0
        left = np.flatnonzero(touching[:-1] & ~touching[1:])
        self.again = recovery.again > 0
        self.came_back = bool(len(left)) and bool(touching[left[0] + 1 :].any())
        self.never = depth > 0.0
        stop, back = self._depths[:STOPPING], self._depths[STOPPING:]
        self.deeper = bool(back) and max(back) > max(stop) + MORE
