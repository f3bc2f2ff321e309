"""The peer of a reach learner: inverse kinematics and RRT-Connect, planned anew on every change and executed through MoBeE.

What it plans with is a belief about robot and world (peer_belief.py); what moves is the plant, which may know more.  Where a
motion ends otherwise than planned it keeps away from that pose and plans again from where it is.  With memory it does so in later
tries too: for good, or for this target where the target was touched, as thesis 9.4.1 tells the own body from the workspace.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from experiments.reaching.judged_plant import JudgedPlant
from experiments.reaching.peer_belief import NEAR, Care, PeerBelief
from experiments.reaching.peer_goals import goals
from experiments.reaching.rrt_connect import rrt_connect, shortened
from mobee.reach import TARGET, ReachTarget
from mobee.robot.robot import Array

OFF = 0.05  # of a motor's range, from where a motion was to end: more was blocked
GOOD = 0.02  # m: what may be missing
LIMIT = 20  # actions a try
NEAREST = 8  # goals that are planned to
ESCAPES = 64  # poses tried, to come away from where it touches something
Memory = Literal["none", "blocked", "missed"]
MEMORIES: tuple[Memory, ...] = ("none", "blocked", "missed")
Ended = Literal["there", "used up", "no plan"]
ENDS: tuple[Ended, ...] = ("there", "used up", "no plan")
Knowledge = tuple[list[Array], dict[bytes, list[Array]]]


@dataclass(frozen=True, slots=True)
class PeerTry:
    """How a try ended.

    `missing`: m, truly.  `ended`: held to be "there", with "no plan" left, or when the actions were "used up": motions were blocked, or
    the target moved.
    `actions`, `plans`: how many.
    `seconds`: of plant time.  `planning`: s of this machine's time.  `looks`: poses looked at.
    """

    missing: float
    ended: Ended
    actions: int
    plans: int
    seconds: float
    planning: float
    looks: int


class PlannerPeer:
    """Brings a marker to targets, one try after the other, from wherever the robot is.

    Args:
        plant: what moves; motors that are not planned with stay where they are at first.
        belief: what is planned with.
        part: of the motors.
        memory: what it knows of earlier tries: nothing, where motions were "blocked", or also which poses "missed" their
            target though nothing blocked them.
        seed: of its draws.
        limit: actions a try.
    """

    def __init__(
        self, plant: JudgedPlant, belief: PeerBelief, part: str, memory: Memory = "none", seed: int = 0, limit: int = LIMIT
    ) -> None:
        self._plant, self._belief, self._part, self._memory, self._limit = plant, belief, part, memory, limit
        self._columns = belief.columns - plant.robot.part(part).start
        self._rest = plant.measure(part)
        self._rng = np.random.default_rng([seed, 86])
        self._goals: dict[bytes, tuple[Array, Array]] = {}
        self._for_good: list[Array] = []
        self._at_target: dict[bytes, list[Array]] = {}
        self._touched: tuple[str, ...] = ()
        self._actions = self._plans = 0
        self._planning = 0.0

    @property
    def remembered(self) -> int:
        """How many poses it keeps away from, in some or all tries."""
        return len(self._for_good) + sum(map(len, self._at_target.values()))

    def knowledge(self) -> Knowledge:
        """What it remembers now, to be given to `restore`."""
        return list(self._for_good), {key: list(poses) for key, poses in self._at_target.items()}

    def restore(self, knowledge: Knowledge) -> None:
        """Remember that, and nothing else."""
        self._for_good, self._at_target = list(knowledge[0]), {key: list(poses) for key, poses in knowledge[1].items()}

    def try_problem(self, target: ReachTarget, sees: Callable[[], ReachTarget] | None = None) -> PeerTry:
        """Present the target, go to it, and back to the pose before.

        `sees`: where the target is believed to be, asked before each action; None: where it is presented.
        """
        if self._memory == "none":
            self.restore(([], {}))
        before = self._counts()
        self._plant.present(target)
        missing, ended = self._approach(sees or (lambda: target))
        actions, plans, seconds, planning, looks = (now - then for now, then in zip(self._counts(), before, strict=True))
        return PeerTry(missing, ended, int(actions), int(plans), seconds, planning, int(looks))

    def _counts(self) -> tuple[float, ...]:
        return self._actions, self._plans, self._plant.time, self._planning, self._belief.looks

    def _approach(self, sees: Callable[[], ReachTarget]) -> tuple[float, Ended]:
        """Plan and go until the marker is held to be there or nothing more can be tried; what is truly missing then, m."""
        missing, stop, ended = np.inf, self._actions + self._limit, ENDS[1]
        while self._actions < stop:
            seen = sees()
            way = self._plan(seen)
            if way is None:
                ended = ENDS[2]
                break
            corners, pose = way
            if not self._follow(corners, seen, sees, stop):
                continue
            here = self._here
            end = self._go(pose)
            missing = self._plant.missing(self._belief.marker)
            believed = sees().missing(self._belief.model.evaluate(self._belief.whole(end)).position(self._belief.marker))
            if believed > GOOD:
                self._note(here, pose, end, seen)
            elif missing > GOOD and self._memory == "missed":
                self._at_target.setdefault(_key(seen), []).append(pose)
            self._go(corners[-1])
            if believed <= GOOD:
                return missing, ENDS[0]
        return (missing if missing < np.inf else self._plant.missing(self._belief.marker)), ended

    def _follow(self, corners: Array, seen: ReachTarget, sees: Callable[[], ReachTarget], stop: int) -> bool:
        """Go along the corners; False as soon as a motion is blocked, the target is elsewhere or too many actions were made."""
        for corner in corners:
            if _key(sees()) != _key(seen) or self._actions >= stop:
                return False
            here = self._here
            end = self._go(corner)
            if self._off(end, corner):
                self._note(here, corner, end, seen)
                return False
        return True

    def _plan(self, target: ReachTarget) -> tuple[Array, Array] | None:
        """Corners to pass, the last before the target, and the pose at it.

        Where what is remembered leaves no way, other goals are drawn; then it is let go, first what was for good.
        """
        begun, belief = time.perf_counter(), self._belief
        belief.present(target)
        at_target = self._at_target.get(_key(target), [])
        found = None
        known = (self._for_good + at_target, self._for_good + at_target, at_target, [])
        for number, remembered in enumerate(known):
            belief.blocked = np.array(remembered).reshape(-1, len(belief.columns))
            if number == 1 and len(belief.blocked):
                self._goals.pop(_key(target))
            found = self._search(target)
            if found is not None or not len(belief.blocked):
                break
        self._plans, self._planning = self._plans + 1, self._planning + time.perf_counter() - begun
        return found

    def _search(self, target: ReachTarget) -> tuple[Array, Array] | None:
        belief, here, key = self._belief, self._here, _key(target)
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

    def _note(self, start: Array, aim: Array, end: Array, target: ReachTarget) -> None:
        """Keep away from where the motion would have gone next; from its aim if it was nearly there."""
        left = (aim - end) / self._belief.span
        ahead = end + min(1.0, NEAR / max(float(np.linalg.norm(left)), 1e-9)) * (aim - end)
        kept = self._at_target.setdefault(_key(target), []) if TARGET in self._touched else self._for_good
        kept.append(ahead)

    def _go(self, q: Array) -> Array:
        """One action; where the motors ended, (d,) rad."""
        whole = self._rest.copy()
        whole[self._columns] = np.clip(q, *self._belief.range.T)
        outcome = self._plant.go(self._part, whole, self._belief.marker)
        self._actions += 1
        self._touched = outcome.touched
        end: Array = outcome.q[self._columns]
        return end

    @property
    def _here(self) -> Array:
        here: Array = self._plant.measure(self._part)[self._columns]
        return here

    def _off(self, end: Array, aim: Array) -> bool:
        return bool((np.abs(end - aim) / self._belief.span).max() > OFF)


def _key(target: ReachTarget) -> bytes:
    return target.position.tobytes()
