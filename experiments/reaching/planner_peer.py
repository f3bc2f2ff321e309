"""The peer of a reach learner: inverse kinematics and RRT-Connect, planned anew on every change and executed through MoBeE.

What it plans with is a belief about robot and world (peer_belief.py); what moves is the plant, which may know more.  Where a
motion ends otherwise than planned it keeps away from that pose and plans again from where it is.  With memory it does so in later
tries too: for good, or for this target where the target was touched, as thesis 9.4.1 tells the own body from the workspace.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from experiments.reaching.peer_belief import PeerBelief
from experiments.reaching.peer_memory import Knowledge, PeerMemory, place_of
from experiments.reaching.peer_plans import PeerPlans
from experiments.reaching.targets import GOOD
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachTarget
from mobee.robot.robot import Array, Robot

OFF = 0.05  # of a motor's range, from where a motion was to end: more was blocked
LIMIT = 20  # actions a try
Memory = Literal["none", "blocked", "missed"]
MEMORIES: tuple[Memory, ...] = ("none", "blocked", "missed")
Ended = Literal["there", "used up", "no plan"]
ENDS: tuple[Ended, ...] = ("there", "used up", "no plan")


@dataclass(frozen=True, slots=True)
class PeerTry:
    """How a try ended.

    `missing`: m, truly.  `ended`: held to be "there", with "no plan" left, or when the actions were "used up": motions were blocked, or
    the target moved.
    `actions`, `plans`: how many.
    `seconds`: of plant time.  `planning`: s of processor time.  `looks`: poses looked at.
    """

    missing: float
    ended: Ended
    actions: int
    plans: int
    seconds: float
    planning: float
    looks: int


class PeerPlant(Protocol):
    """What the peer drives; the target repels no hand of it."""

    @property
    def robot(self) -> Robot:
        """Of the plant."""
        ...

    @property
    def time(self) -> float:
        """Plant time in s."""
        ...

    def measure(self, part: str) -> Array:
        """See Plant."""
        ...

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """As `Plant.act`, but the marker's hand does not feel the target."""
        ...

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        ...

    def missing(self, marker: str) -> float:
        """How far the marker is from where it is to be, now; m."""
        ...


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

    def __init__(self, plant: PeerPlant, belief: PeerBelief, part: str, memory: Memory = "none", seed: int = 0, limit: int = LIMIT) -> None:
        self._plant, self._belief, self._part, self._memory, self._limit = plant, belief, part, memory, limit
        self._columns = belief.columns - plant.robot.part(part).start
        self._rest = plant.measure(part)
        self._ways, self._known = PeerPlans(belief, seed), PeerMemory(belief.span)
        self._touched: tuple[str, ...] = ()
        self._actions = self._plans = 0
        self._planning = 0.0

    @property
    def remembered(self) -> int:
        """How many poses it keeps away from, in some or all tries."""
        return len(self._known)

    def knowledge(self) -> Knowledge:
        """What it remembers now, to be given to `restore`."""
        return self._known.knowledge()

    def restore(self, knowledge: Knowledge) -> None:
        """Remember that, and nothing else."""
        self._known.restore(knowledge)

    def try_problem(self, target: ReachTarget, sees: Callable[[], ReachTarget] | None = None) -> PeerTry:
        """Present the target, go to it, and back to the pose before.

        `sees`: where the target is believed to be, asked before each action; None: where it is presented.
        """
        if self._memory == "none":
            self._known.clear()
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
            end = self._go(pose)
            missing = self._plant.missing(self._belief.marker)
            believed = sees().missing(self._belief.model.evaluate(self._belief.whole(end)).position(self._belief.marker))
            if believed > GOOD:
                self._note(pose, end, seen)
            elif missing > GOOD and self._memory == "missed":
                self._known.missed(pose, seen)
            self._go(corners[-1])
            if believed <= GOOD:
                return missing, ENDS[0]
        return (missing if missing < np.inf else self._plant.missing(self._belief.marker)), ended

    def _follow(self, corners: Array, seen: ReachTarget, sees: Callable[[], ReachTarget], stop: int) -> bool:
        """Go along the corners; False as soon as a motion is blocked, the target is elsewhere or too many actions were made."""
        for corner in corners:
            if place_of(sees()) != place_of(seen) or self._actions >= stop:
                return False
            end = self._go(corner)
            if self._off(end, corner):
                self._note(corner, end, seen)
                return False
        return True

    def _plan(self, target: ReachTarget) -> tuple[Array, Array] | None:
        begun = time.process_time()
        found = self._ways.way(target, self._here, self._known)
        self._plans, self._planning = self._plans + 1, self._planning + time.process_time() - begun
        return found

    def _go(self, q: Array) -> Array:
        """One action; where the motors ended, (d,) rad."""
        whole = self._rest.copy()
        whole[self._columns] = np.clip(q, *self._belief.range.T)
        outcome = self._plant.go(self._part, whole, self._belief.marker)
        self._actions += 1
        self._touched = outcome.touched
        end: Array = outcome.q[self._columns]
        return end

    def _note(self, aim: Array, end: Array, target: ReachTarget) -> None:
        self._known.blocked(aim, end, target, TARGET in self._touched)

    @property
    def _here(self) -> Array:
        here: Array = self._plant.measure(self._part)[self._columns]
        return here

    def _off(self, end: Array, aim: Array) -> bool:
        return bool((np.abs(end - aim) / self._belief.span).max() > OFF)
