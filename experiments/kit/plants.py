# SPDX-License-Identifier: Apache-2.0
"""Plants of experiments: one with MuJoCo in one process, and one that passes all calls to another plant.

`PhysicsPlant` runs model, controller and physics tick by tick, as the live system runs them in lockstep.  It has two worlds: in the model's
world, objects are where the robot believes them to be; in the world of the physics, they are at their true places.  `WrappedPlant` is the
base class of plants that observe what an agent does, or falsify what it measures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from mobee import Controller, Model, World
from mobee.arrays import Array
from mobee.behaviours.bump import BumpWatch
from mobee.behaviours.pick import BACK, CALM, Followed, Forces
from mobee.control import SettleTest
from mobee.control.gains import Verdict
from mobee.model.pose import Pose, touched_by
from mobee.model.world_object import WorldObject
from mobee.plant import Outcome
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget
from mobee.roadmap.playback import PERIOD, attractors, timed
from mobee.simulation.actions import ReachesUnderWay
from mobee.simulation.motors import MotorParameters
from services.robot_sim.strength import with_torques

if TYPE_CHECKING:
    from services.robot_sim.mujoco_backend import MujocoBackend

P = TypeVar("P", bound=ReachPlant)
DT = 0.01  # s
SLOW = float(np.deg2rad(1.0))  # rad/s, of motors at rest
_MOVING: Verdict = "moving"


class WrappedPlant(Generic[P]):
    """A `mobee.reach.ReachPlant` that passes every call to the plant `inner`; a subclass changes some of the methods."""

    def __init__(self, inner: P) -> None:
        self.inner, self.robot = inner, inner.robot

    @property
    def q(self) -> Array:
        """The present encoder values of all motors of the inner plant, (n,) rad, in the order of `robot.motors`."""
        return self.inner.q

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the part's motors, (n_part,) rad, from the inner plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """Perform the action on the inner plant: set the attractor to `target` (n_part,) rad and wait, as in `mobee.plant.Plant.act`."""
        return self.inner.act(part, target)

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world of the inner plant, or move it there; None removes it, as in `mobee.reach.ReachPlant.present`."""
        self.inner.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Perform the reach on the inner plant: pull the marker to the presented target, as in `mobee.reach.ReachPlant.reach`.

        `stay`: the part stays where the reach ended; otherwise its attractor pulls it back.
        """
        return self.inner.reach(part, marker, stay)


class PhysicsPlant:
    """A `mobee.reach.ReachPlant` whose body MuJoCo simulates, under the control law's default gains and with the default motor parameters.

    Args:
        model: the robot in the world as it is believed to be.
        truth: the world that MuJoCo simulates, with all objects at their true places.
        seed: of the encoders' noise.
        start: (n,) rad, the posture at the start, at rest.
        torques: largest torques of motors, N m, by pattern of motor names, as "?_pinky"; the other motors keep those of the robot's file.
    """

    def __init__(self, model: Model, truth: World, seed: int, start: Array, torques: Mapping[str, float]) -> None:
        from services.robot_sim.mujoco_backend import MujocoBackend  # optional

        self.model, self.robot, self.dt = model, model.robot, DT
        self.controller = Controller(model)
        self.body: MujocoBackend = MujocoBackend(with_torques(model.robot, torques), lambda: truth, MotorParameters(), seed, DT)
        self.body.set_posture(start)
        self.controller.reset(start)
        self._track, self._reaches = model.track(), ReachesUnderWay(model, self.controller)
        self._command, self._encoders = np.zeros(len(start)), start.copy()
        self._pose: Pose = model.evaluate(start)
        self._ticks = 0
        self._watch: Callable[[float], None] | None = None
        self.exempt: str | None = None
        """Name of a marker on whose hand the targets exert no force; None: no marker."""

    @property
    def q(self) -> Array:
        """The present encoder values of all motors, (n,) rad, in the order of `robot.motors`."""
        return self._encoders.copy()

    @property
    def time(self) -> float:
        """The simulated time since the start, s."""
        return self._ticks * self.dt

    @property
    def things(self) -> Mapping[str, WorldObject]:
        """A dict from the name of each object of the physics engine to the object at its true pose."""
        return self.body.world.objects

    def every_tick(self, callback: Callable[[float], None] | None) -> None:
        """Call `callback` with the simulated time [s] after every tick, for example to take pictures; None: call nothing any more."""
        self._watch = callback

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the part's motors, (n_part,) rad."""
        return self._encoders[self.robot.part(part).slice].copy()

    def tick(self) -> None:
        """Run one control tick (10 ms); a command moves the motors in the tick after the one in which it was computed."""
        self._ticks += 1
        self._encoders = self.body.motors.encoders(self._ticks, self.dt)
        reaching = self._reaches.reaching
        self._pose = self._track.evaluate(
            self._encoders, (*reaching, self.exempt) if self.exempt and self.exempt not in reaching else reaching
        )
        velocity = self.controller.step(self._encoders, self.dt, pose=self._pose).velocity.copy()
        self.body.motors.command(slice(None), "velocity", self._command)
        self.body.step(self.dt)
        self._command = velocity
        if self._watch is not None:
            self._watch(self.time)

    def run(self, seconds: float) -> None:
        """Run control ticks for `seconds` of simulated time."""
        for _ in range(round(seconds / self.dt)):
            self.tick()

    def act(self, part: str, target: Array) -> Outcome:
        """Move the part to `target` (n_part,) rad: run until it has settled or timed out, as in `mobee.plant.Plant.act`.

        The target becomes the part's attractor, the posture to which the control law pulls.
        """
        self._reaches.drop(part)
        self.controller.set_attractor(part, target)
        return self._settled(part)

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world of the model, or move it there; None removes it, as in `mobee.reach.ReachPlant.present`."""
        self._reaches.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Pull the marker by a force to the presented target until the part settles or times out, as in `mobee.reach.ReachPlant.reach`.

        `stay`: True: the part stays in the pose in which the force ended, which becomes its attractor (the posture to which the control law
        pulls).  False: the attractor is unchanged and pulls the part back when the force has ended.
        """
        self._reaches.begin(part, marker, stay)
        end = self._settled(part)
        while self._reaches.ended(part, end, self.model.evaluate(self._encoders)):
            end = self._settled(part)
        return self._reaches.outcome(part)

    def follow_path(self, path: Array, speed: float, watch: BumpWatch | None = None, forces: Forces | None = None) -> Followed:
        """Move along a path, and return how the motion ended.

        `path`: (K, n) rad, postures in order of time.  `speed`: share of the largest speed.  `watch`: detects bumps; after a bump the robot
        moves back a little and the motion ends; None: bumps are not detected. `forces`: function that takes a posture (n,) rad and returns
        the forces (n,) rad/s^2 of the control law except spring and damping.  The attractor is shifted such that its spring cancels these
        forces; None: they are not cancelled.  The method implements `mobee.behaviours.pick.Body.follow_path`.
        """
        wanted = timed(self.robot, np.clip(path, *self.robot.limits.T), self.controller.gains, speed)
        if watch is not None:
            watch.begin()
        passed: list[Array] = []
        for attractor in attractors(self.robot, wanted, self.controller.gains, forces):
            self.controller.attractor = attractor
            for _ in range(round(PERIOD / self.dt)):
                self.tick()
                if watch is not None and watch.note(self._encoders, self.body.motors.efforts, self.dt):
                    found = Followed(True, self.q)
                    self.rest_at(passed[-min(len(passed), round(BACK / PERIOD))] if passed else self.q)
                    return found
            passed.append(self.q)
        self._calm()
        return Followed(False, self.q)

    def press(self, q: Array, seconds: float) -> None:
        """Set the attractor (posture to which the control law pulls) to q (n,) rad in one step, and run for `seconds` of simulated time."""
        self.controller.attractor = q
        self.run(seconds)

    def rest_at(self, q: Array) -> None:
        """Move to q (n,) rad as `press` does, but run until no motor is commanded to move, and not longer than 1.5 s."""
        self.controller.attractor = q
        self._calm()

    def _calm(self) -> None:
        """Run until no motor is commanded to move, or for CALM s."""
        end = self.time + CALM
        self.run(0.2)
        while self.time < end and np.abs(self.controller.velocity).max() > SLOW:
            self.run(0.1)

    def _settled(self, part: str) -> Outcome:
        """Run until the part has settled or timed out."""
        where, begun = self.robot.part(part).slice, self.time
        test, verdict = SettleTest(self.controller.gains.settle, begun), _MOVING
        while verdict == "moving":
            self.tick()
            speeds, changes = self.controller.velocity[where], self.controller.acceleration[where]
            verdict = test.update(self.time, np.abs(speeds), np.abs(changes))
        return Outcome(self.measure(part), verdict == "settled", self.time - begun, touched_by(self._pose, part))
