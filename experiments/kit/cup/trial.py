# SPDX-License-Identifier: Apache-2.0
"""One trial of the cup experiment: reach the pre-grasp, close the hand, lift the cup, put it elsewhere; judged by simulated true poses."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from experiments.kit.cup.approaches import (
    CUP,
    FALLEN,
    HEIGHT,
    INFLATED,
    RADIUS,
    TOP,
    Eyes,
    Placement,
    RrtPlanner,
    by_learner,
    ready,
    roadmap,
    robot,
    roomy_placement,
    side_grasp,
    standing,
    table,
    true_world,
)
from experiments.kit.plants import PhysicsPlant
from mobee import Model
from mobee.arrays import Array
from mobee.behaviours.grasp import palm_beside
from mobee.behaviours.pick import NoPosture, Picker, Upright, places_near
from mobee.behaviours.pre_grasp import MARKER, WATCHED, Approach, MapPlanner, approach
from mobee.model.world_object import WorldObject

TORQUES = {"?_*_distal": 0.09, "?_pinky": 0.09, "?_hand_finger": 0.3, "?_thumb_*": 0.3, "?_index_*": 0.3, "?_middle_*": 0.3}
"""Largest torques of the finger motors, N m, by pattern of motor names; the robot's file has 40 N m for all motors."""
NEAR, ANGLE = 0.02, float(np.deg2rad(15.0))  # m and rad, of the pre-grasp
LIFTED, PLACED = 0.05, 0.05  # m: how high the cup must come, and how near to its goal
UPRIGHT = float(np.deg2rad(10.0))
SHIFTS = 0.07, 0.16  # m, of the goal from where the cup stood
GOALS = 24


@dataclass(slots=True)
class Result:
    """The measures of a trial, in m, rad and s; -1 (0 for `lifted`): not measured, because the trial ended earlier.

    The pre-grasp is the pose with the open hand beside the cup.  Measured at the end of the motion to it: `distance`: distance of the palm
    from its wanted place beside the true cup.  `angle`: angle between the palm's normal and its wanted direction.  `pushed`: largest
    distance by which an object was moved.  `knocked`: whether a movable object leans more than 25 degrees.  `pre_grasp`: whether `distance`
    is at most 2 cm, `angle` is at most 15 degrees, and nothing was knocked over.

    Measured later: `lifted`: height by which the cup was lifted from the table.  `placed`: horizontal distance of the cup from its goal at
    the end.  `done`: whether the cup was lifted, and put down upright near its goal, and nothing was knocked over.  `bumps`: number of
    bumps on the motion to the pre-grasp.  `plans`: how often a path was planned.  `planning`: processor time of the plans.  `clutter`:
    number of pieces of clutter.  `why`: reason of a failure.  `seconds`: simulated time.
    """

    pre_grasp: bool = False
    done: bool = False
    distance: float = -1.0
    angle: float = -1.0
    pushed: float = -1.0
    knocked: bool = False
    lifted: float = 0.0
    placed: float = -1.0
    bumps: int = 0
    plans: int = 0
    planning: float = 0.0
    clutter: int = 0
    why: str = ""
    seconds: float = 0.0


class Trial:
    """A trial in a random scene; `run` performs it.

    The physics has the true world.  The robot's model has the world as the cameras see it, with small errors and without hidden clutter.
    `method`: "map" (pre-grasp map), "learner" (learned reacher) or "rrt" (RRT-Connect).  `seed`: seed of the scene, the errors of the
    cameras and the plant.
    """

    def __init__(self, method: str, seed: int) -> None:
        self.scene: Placement = roomy_placement(seed)
        self.eyes = Eyes(self.scene, seed)
        self.seen = self.eyes.cup(self.scene.cup)
        known, planned = table(), table()
        self.eyes.show(known, self.seen, 0.0)
        self.eyes.show(planned, self.seen, INFLATED)
        self.plant = PhysicsPlant(Model(robot(), known), true_world(self.scene), seed, ready(), TORQUES)
        self.plant.exempt = MARKER
        self._planned = Model(robot(), planned)
        self.grasp = side_grasp(self._planned)
        self.picker = Picker(self.plant, self.grasp, WATCHED)
        self._method, self._seed = method, seed
        self.result = Result(clutter=len(self.scene.clutter))
        self._before = {name: thing.position[:2].copy() for name, thing in self.plant.things.items()}

    def run(self) -> Result:
        """Perform the trial and return its measures."""
        self.picker.settle_at(ready())
        found = self._approach()
        result = self.result
        result.bumps, result.plans, result.planning = found.bumps, found.plans, found.planning
        if found.azimuth is None:
            result.why = "no path to the pre-grasp"
        else:
            self._judge(found.azimuth)
            self._pick(found.azimuth)
        result.seconds = self.plant.time
        return result

    def _approach(self) -> Approach:
        if self._method == "learner":
            return by_learner(self.plant, self.seen)
        planner = MapPlanner(roadmap(), self._planned, MARKER) if self._method == "map" else RrtPlanner(self._planned, self._seed)
        return approach(self.plant, self.picker, self.seen, planner)

    def _judge(self, azimuth: float) -> None:
        """Compare the pose of the palm with its wanted pose beside the true place of the cup, and store the measures in `self.result`.

        `azimuth`: direction that the palm faces by the plan of the approach, rad.
        """
        things, result = self.plant.things, self.result
        cup = things[CUP].position[:2]
        wanted = palm_beside(cup, RADIUS, azimuth, self.grasp.grip.before, TOP, self.grasp.grip)
        pose = self.plant.model.evaluate(self.plant.body.motors.q)
        result.distance = float(np.linalg.norm(pose.position(MARKER) - wanted.position))
        result.angle = float(np.arccos(np.clip(pose.rotation(MARKER)[:, 2] @ wanted.rotation[:, 2], -1.0, 1.0)))
        result.pushed = max(float(np.linalg.norm(things[name].position[:2] - at)) for name, at in self._before.items())
        result.knocked = any(leans(thing) > FALLEN for thing in things.values() if thing.movable)
        result.pre_grasp = bool(result.distance <= NEAR and result.angle <= ANGLE and not result.knocked)

    def _pick(self, azimuth: float) -> None:
        result, world = self.result, self._planned.world
        cup = self.plant.things[CUP]
        if leans(cup) > FALLEN:
            result.why = "the cup fell before the grasp"
            return
        seen = self.eyes.cup(cup.position[:2])  # looks again
        world.set_role(CUP, "ghost")
        try:
            self.picker.close(seen, azimuth)
            self.picker.lift(seen, azimuth)
            cup = self.plant.things[CUP]
            result.lifted = float(cup.position[2] - standing(cup.position[:2], HEIGHT)[2])
            if result.lifted < LIFTED:
                result.why = "the cup was not lifted"
                return
            centre = np.append(self.eyes.cup(cup.position[:2]).place, cup.position[2])
            goal = self.picker.put(seen, self._goals(seen, azimuth), centre)
        except NoPosture as error:
            result.why = str(error)
            return
        cup = self.plant.things[CUP]
        result.placed = float(np.linalg.norm(cup.position[:2] - goal))
        knocked = any(leans(thing) > FALLEN for thing in self.plant.things.values() if thing.movable)
        stands = leans(cup) < UPRIGHT and abs(cup.position[2] - standing(goal, HEIGHT)[2]) < 0.01
        result.done = bool(stands and result.placed <= PLACED and not knocked)
        result.why = (
            "" if result.done else "the cup does not stand at its goal" if not stands else "off its goal" if not knocked else "clutter fell"
        )

    def _goals(self, thing: Upright, azimuth: float) -> list[Array]:
        """Return places (2,) m, root frame, to which the cup `thing` can be moved, without seen clutter near them.

        `azimuth`: direction that the palm faced in the grasp, rad, as in `places_near`, which states the order of the places.
        """
        places = places_near(thing.place, azimuth, SHIFTS, GOALS, np.random.default_rng([self._seed, 437]))
        others = [item.position[:2] for name, item in self._planned.world.objects.items() if name not in ("table", CUP)]
        clear = [place for place in places if all(np.linalg.norm(place - other) > 0.09 for other in others)]
        return [place for place in clear if -0.45 < place[0] < -0.24 and -0.08 < place[1] < 0.24]


def leans(thing: WorldObject) -> float:
    """Return the angle between a thing's z axis and the vertical, rad."""
    return float(np.arccos(np.clip(thing.rotation[2, 2], -1.0, 1.0)))


def run_trial(method: str, seed: int) -> dict[str, object]:
    """Perform a trial and return its measures as JSON values, by the names of the fields of `Result`.

    `method`: "map" (pre-grasp map), "learner" (learned reacher) or "rrt" (RRT-Connect).  `seed`: seed of the scene, the errors of the
    cameras and the plant.
    """
    return asdict(Trial(method, seed).run())
