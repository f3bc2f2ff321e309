"""The peer of a reach learner: inverse kinematics and RRT-Connect, planned anew on every change and executed through MoBeE.

It plans with a belief about robot and world (belief.py); the plant that moves may differ from it.  Where a motion ends otherwise than
planned, the peer avoids that pose and plans again from where it is.  With memory it does so in later tries too: for good, or for this
target alone where the target was touched, as thesis 9.4.1 distinguishes body and workspace.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from experiments.kit.reaching.belief import NEAR, Care, PeerBelief, goals, rrt_connect, shortened
from experiments.kit.reaching.targets import GOOD
from mobee.arrays import Array
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachTarget
from mobee.robot.robot import Robot

Knowledge = tuple[list[Array], dict[bytes, list[Array]]]


class PeerMemory:
    """Blocked poses of the motors, (d,) rad; where the target was touched they count for it alone (thesis 9.4.1).

    `span`: (d,) rad, how wide the motors' ranges are.
    """

    def __init__(self, span: Array) -> None:
        self._span = span
        self._for_good: list[Array] = []
        self._at_target: dict[bytes, list[Array]] = {}

    def __len__(self) -> int:
        return len(self._for_good) + sum(map(len, self._at_target.values()))

    def knowledge(self) -> Knowledge:
        """All of it, to be given to `restore`."""
        return list(self._for_good), {place: list(poses) for place, poses in self._at_target.items()}

    def restore(self, knowledge: Knowledge) -> None:
        """Remember that, and nothing else."""
        self._for_good, self._at_target = list(knowledge[0]), {place: list(poses) for place, poses in knowledge[1].items()}

    def clear(self) -> None:
        """Forget everything."""
        self.restore(([], {}))

    def blocked(self, aim: Array, end: Array, target: ReachTarget, touched: bool) -> None:
        """A motion to `aim` ended elsewhere: avoid the pose that it would have passed next, or its aim if that is nearer."""
        left = (aim - end) / self._span
        ahead = end + min(1.0, NEAR / max(float(np.linalg.norm(left)), 1e-9)) * (aim - end)
        if touched:
            self.missed(ahead, target)
        else:
            self._for_good.append(ahead)

    def missed(self, pose: Array, target: ReachTarget) -> None:
        """Avoid a pose when reaching for this target."""
        self._at_target.setdefault(place_of(target), []).append(pose)

    def of(self, target: ReachTarget) -> tuple[Array, Array]:
        """Poses to avoid for this target, (B, d) rad: all, and those of this target alone."""
        here = self._at_target.get(place_of(target), [])
        everything, alone = (np.array(poses).reshape(-1, len(self._span)) for poses in (self._for_good + here, here))
        return everything, alone


def place_of(target: ReachTarget) -> bytes:
    """The same for targets at the same place."""
    return target.position.tobytes()


NEAREST = 8  # goals that are planned to
ESCAPES = 64  # poses tried, to come away from where it touches something


class PeerPlans:
    """Plans of one belief; the goals of a target are kept, and drawn anew where the remembered poses leave no path to them.

    `seed`: of its draws.
    """

    def __init__(self, belief: PeerBelief, seed: int) -> None:
        self._belief = belief
        self._rng = np.random.default_rng([seed, 86])
        self._goals: dict[bytes, tuple[Array, Array]] = {}

    def path(self, target: ReachTarget, here: Array, memory: PeerMemory) -> tuple[Array, Array] | None:
        """From a pose (d,) rad: the corners to pass, the last before the target, and the pose at it; None: no path was found.

        Where the remembered poses leave none, other goals are drawn; then they are ignored, first those for good.
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


OFF = 0.05  # of a motor's range, from where a motion was to end: more was blocked
LIMIT = 20  # actions a try
Memory = Literal["none", "blocked", "missed"]
MEMORIES: tuple[Memory, ...] = ("none", "blocked", "missed")
Ended = Literal["there", "used up", "no plan"]
ENDS: tuple[Ended, ...] = ("there", "used up", "no plan")


@dataclass(frozen=True, slots=True)
class PeerTry:
    """How a try ended.

    `missing`: true remaining error, m.  `ended`: believed to be "there"; with "no plan"; or with the actions "used up", since motions
    were blocked or the target moved.
    `actions`, `plans`: how many.
    `seconds`: of plant time.  `planning`: s of processor time.  `checked`: poses checked.
    """

    missing: float
    ended: Ended
    actions: int
    plans: int
    seconds: float
    planning: float
    checked: int


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
        memory: of earlier tries: nothing, where motions were "blocked", or also which poses "missed" their
            target though nothing blocked them.
        seed: of its draws.
        limit: actions a try.
    """

    def __init__(self, plant: PeerPlant, belief: PeerBelief, part: str, memory: Memory = "none", seed: int = 0, limit: int = LIMIT) -> None:
        self._plant, self._belief, self._part, self._memory, self._limit = plant, belief, part, memory, limit
        self._columns = belief.columns - plant.robot.part(part).start
        self._rest = plant.measure(part)
        self._routes, self._known = PeerPlans(belief, seed), PeerMemory(belief.span)
        self._touched: tuple[str, ...] = ()
        self._actions = self._plans = 0
        self._planning = 0.0

    @property
    def remembered(self) -> int:
        """How many poses it avoids, in some or all tries."""
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
        actions, plans, seconds, planning, checked = (now - then for now, then in zip(self._counts(), before, strict=True))
        return PeerTry(missing, ended, int(actions), int(plans), seconds, planning, int(checked))

    def _counts(self) -> tuple[float, ...]:
        return self._actions, self._plans, self._plant.time, self._planning, self._belief.checked

    def _approach(self, sees: Callable[[], ReachTarget]) -> tuple[float, Ended]:
        """Plan and go until the marker is believed there or nothing more can be tried; the true remaining error, m."""
        missing, stop, ended = np.inf, self._actions + self._limit, ENDS[1]
        while self._actions < stop:
            seen = sees()
            plan = self._plan(seen)
            if plan is None:
                ended = ENDS[2]
                break
            corners, pose = plan
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
        found = self._routes.path(target, self._here, self._known)
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
