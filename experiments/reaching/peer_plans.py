"""Ways of a planner peer to targets: inverse kinematics once a target, RRT-Connect each time."""

from __future__ import annotations

import numpy as np

from experiments.reaching.peer_belief import Care, PeerBelief
from experiments.reaching.peer_goals import goals
from experiments.reaching.peer_memory import PeerMemory, place_of
from experiments.reaching.rrt_connect import rrt_connect, shortened
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

NEAREST = 8  # goals that are planned to
ESCAPES = 64  # poses tried, to come away from where it touches something


class PeerPlans:
    """Plans by a belief; the goals of a target are kept, and drawn anew where what is remembered leaves no way to them.

    `seed`: of its draws.
    """

    def __init__(self, belief: PeerBelief, seed: int) -> None:
        self._belief = belief
        self._rng = np.random.default_rng([seed, 86])
        self._goals: dict[bytes, tuple[Array, Array]] = {}

    def way(self, target: ReachTarget, here: Array, memory: PeerMemory) -> tuple[Array, Array] | None:
        """From a pose (d,) rad: the corners to pass, the last before the target, and the pose at it; None: there is no way.

        Where what is remembered leaves none, other goals are drawn; then it is let go, first what was for good.
        """
        belief = self._belief
        belief.present(target)
        everything, of_target = memory.of(target)
        for number, remembered in enumerate((everything, everything, of_target, of_target[:0])):
            belief.blocked = remembered
            if number == 1 and len(remembered):
                self._goals.pop(place_of(target))
            found = self._search(target, here)
            if found is not None or not len(remembered):
                return found
        return None

    def _search(self, target: ReachTarget, here: Array) -> tuple[Array, Array] | None:
        belief, key = self._belief, place_of(target)
        if key not in self._goals:
            self._goals[key] = goals(belief, target, self._rng)
        poses, befores = self._goals[key]
        free = np.flatnonzero(belief.sound(poses, "grasping") & belief.sound(befores)) if len(poses) else np.array([], dtype=np.intp)
        if not len(free):
            return None
        near = free[np.argsort(np.linalg.norm((befores[free] - here) / belief.span, axis=1))[:NEAREST]]
        start, escape = here, np.zeros((0, len(here)))
        if not belief.sound(here[None])[0]:
            start = self._escape(here)
            escape = start[None]
        path = self._path(start, befores[near])
        if path is None:
            return None
        chosen = near[int(np.argmin(np.abs(befores[near] - path[-1]).max(axis=1)))]
        return np.concatenate([escape, path[1:]]) if len(path) > 1 or len(escape) else path, poses[chosen]

    def _path(self, start: Array, ends: Array) -> Array | None:
        """Through what no field feels, if start and end allow that, else through what no solid touches."""
        belief = self._belief
        clear = ends[belief.sound(ends, "fields")]
        cares: tuple[Care, ...] = ("fields", "solids") if len(clear) and belief.sound(start[None], "fields")[0] else ("solids",)
        for care in cares:
            path = rrt_connect(belief, start, clear if care == "fields" else ends, int(self._rng.integers(2**31)), care)
            if path is not None:
                return shortened(belief, path, self._rng, care)
        return None

    def _escape(self, here: Array) -> Array:
        """The nearest sound pose among some that are drawn around here, further and further away."""
        belief = self._belief
        for width in (0.05, 0.1, 0.2, 0.4):
            drawn = np.clip(here + width * belief.span * self._rng.normal(size=(ESCAPES, len(here))), *belief.range.T)
            drawn = drawn[belief.sound(drawn)]
            if len(drawn):
                nearest: Array = drawn[np.argmin(np.linalg.norm((drawn - here) / belief.span, axis=1))]
                return nearest
        return here
