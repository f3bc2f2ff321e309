# SPDX-License-Identifier: Apache-2.0
"""Solvers of inverse kinematics for comparison with the library's, on the same problems: mink, and optimisers of the thesis (rivals).

The rivals (thesis 3.1.1) are CMA-ES, simulated annealing, a particle filter and xNES; each ends at the first pose within all tolerances.
mink computes differential inverse kinematics on MuJoCo by quadratic programs; here it is restarted, and its poses are tested for contacts
by MoBeE.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import mobee
from experiments.bench.peers import CmaStrategy, import_peer, load_mujoco
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.roadmap.evolution.search import Restart, Search
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.solve import NEAR, STD
from mobee.roadmap.ik.terms import Term
from mobee.robot.robot import Robot

MARKER = "right_palm"

# Simulated annealing and particle filter; steps and noise in shares of the motors' ranges.
ANNEALING_PERIOD = 4000  # poses of one annealing
FIRST_TEMPERATURE, LAST_TEMPERATURE = 1.0, 0.003  # in units of the cost
FIRST_STEP, LAST_STEP = 0.2, 0.01
PARTICLES, SELECTIVITY = 200, 4.0  # the share of a particle falls e-fold with 1/4 of the costs' deviation
NOISE_DECAY = 0.93  # per generation
XNES_PATIENCE = 400  # generations of xNES without gain, ten times those of ours: it is slower

# mink: the best among 0 to 10, 12 to 60 and 0.1 to 0.4.
MINK_DAMPING = 1.0  # of Levenberg-Marquardt
MINK_STEPS = 12  # of one start
ORIENTATION_WEIGHT = 0.4  # m/rad
STOP_SHARE = 0.9  # of the tolerances, at which mink stops


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A target pose of the right palm and its tolerances.

    `position` (3,) m and `rotation` (3, 3), root frame.  `metres` and `radians`: tolerances of position and orientation.
    """

    position: Array
    rotation: Array
    metres: float = 0.005
    radians: float = float(np.deg2rad(5.0))

    def costs(self) -> list[Term]:
        """Return the cost terms of a pose: errors of the palm's position and orientation, depths of contacts, and distance from home."""
        costs = mobee.costs
        return [
            costs.position(MARKER, self.position, self.metres),
            costs.orientation(MARKER, self.rotation, self.radians),
            costs.collision(),
            costs.home(),
        ]


def xnes(problem: Problem, seed: int, most: int) -> Array | None:
    """Search for a pose by xNES as published (Glasmachers 2010), with its default population.

    Limits and restarts are those of the library's NES, but it restarts only after ten times as many generations without gain.  Returns a
    pose (n,) rad within all tolerances, or None after `most` evaluations.  `seed`: of the random numbers.  `problem`: the inverse
    kinematics problem.  `most`: largest number of evaluations (poses whose cost is computed).
    """
    low, high = problem.limits.T
    start, restart = problem.start[problem.free], Restart(patience=XNES_PATIENCE)
    search = Search(start, STD * (high - low), problem.limits, restart, method="xnes", seed=seed)
    return _search(problem, most, lambda: problem.whole(search.ask()), search.tell)


def cma(problem: Problem, seed: int, most: int, batched: bool) -> Array | None:
    """Search for a pose by CMA-ES with its default population.  It restarts at a random posture whenever its own criteria stop it.

    `batched`: the poses of a generation are evaluated in one batch, not one by one.  Returns a pose (n,) rad within all tolerances, or None
    after `most` evaluations.  `seed`: of the random numbers.  `problem`: the inverse kinematics problem.  `most`: largest number of
    evaluations (poses whose cost is computed).
    """
    rng = np.random.default_rng(seed)
    start = _units(problem, problem.start[problem.free])
    strategy = CmaStrategy(start, STD, seed, limits=(0.0, 1.0))

    def tell(costs: Array) -> None:
        nonlocal strategy
        strategy.tell(costs)
        if strategy.stopped:
            strategy = CmaStrategy(rng.uniform(size=len(start)), STD, int(rng.integers(1 << 30)), limits=(0.0, 1.0))

    return _search(problem, most, lambda: _poses(problem, strategy.ask()), tell, batched)


def annealing(problem: Problem, seed: int, most: int) -> Array | None:
    """Search for a pose by simulated annealing, one pose at a time.

    The size of the steps and the temperature decrease together during ANNEALING_PERIOD (4000) poses; then the search restarts at the best
    pose.  Returns a pose (n,) rad within all tolerances, or None after `most` evaluations.  `seed`: of the random numbers.  `problem`: the
    inverse kinematics problem.  `most`: largest number of evaluations (poses whose cost is computed).
    """
    rng = np.random.default_rng(seed)
    best = here = there = _units(problem, problem.start[problem.free])
    cost = least = np.inf
    done = 0.0

    def ask() -> Array:
        nonlocal here, cost, there, done
        done = problem.evaluations % ANNEALING_PERIOD / ANNEALING_PERIOD
        if done == 0.0:
            here, cost = best, least
        step = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** done * rng.standard_normal(len(here))
        there = np.clip(here + step, 0.0, 1.0)
        return _poses(problem, there[None])

    def tell(costs: Array) -> None:
        nonlocal best, here, cost, least
        temperature = FIRST_TEMPERATURE * (LAST_TEMPERATURE / FIRST_TEMPERATURE) ** done
        if costs[0] < cost or rng.uniform() < np.exp((cost - costs[0]) / temperature):
            here, cost = there, float(costs[0])
            if cost < least:
                best, least = here, cost

    return _search(problem, most, ask, tell)


def particles(problem: Problem, seed: int, most: int) -> Array | None:
    """Search for a pose by a particle filter.

    In each generation particles are resampled by their costs, and noise is added.  The noise decreases; when it is small, the search
    restarts with uniform random particles.  Returns a pose (n,) rad within all tolerances, or None after `most` evaluations.  `seed`: of
    the random numbers.  `problem`: the inverse kinematics problem.  `most`: largest number of evaluations (poses whose cost is computed).
    """
    rng = np.random.default_rng(seed)
    noise, places = 0.0, rng.uniform(size=(PARTICLES, len(problem.free)))

    def tell(costs: Array) -> None:
        nonlocal noise, places
        noise = FIRST_STEP if noise == 0.0 else noise * NOISE_DECAY
        if noise < LAST_STEP / 10.0:
            noise, places = 0.0, rng.uniform(size=places.shape)
            return
        shares = np.exp(-SELECTIVITY * (costs - costs.min()) / max(float(costs.std()), 1e-9))
        drawn = rng.choice(PARTICLES, PARTICLES, p=shares / shares.sum())
        places = np.clip(places[drawn] + noise * rng.standard_normal(places.shape), 0.0, 1.0)

    return _search(problem, most, lambda: _poses(problem, places), tell)


def _search(problem: Problem, most: int, ask: Callable[[], Array], tell: Callable[[Array], object], batched: bool = True) -> Array | None:
    """Search for a pose within all tolerances; return it, or None after `most` evaluations.

    In each generation `ask` returns poses (B, n) rad, and `tell` gets their costs (B,).  `batched`: whether the poses of a generation are
    evaluated together; else one by one.
    """
    while problem.evaluations < most:
        q = ask()
        parts = [problem.evaluate(q)] if batched else [problem.evaluate(one[None]) for one in q]
        costs, good = (np.concatenate(part) for part in zip(*parts, strict=True))
        if good.any():
            found: Array = q[int(good.argmax())]
            return found
        tell(costs)
    return None


def _units(problem: Problem, q: Array) -> Array:
    low, high = problem.limits.T
    units: Array = (q - low) / (high - low)
    return units


def _poses(problem: Problem, units: Array) -> Array:
    low, high = problem.limits.T
    return problem.whole(np.clip(low + units * (high - low), low, high))


def load_mink() -> Any:
    """Return the imported package mink; raises NotInstalled if it is missing."""
    return import_peer("mink", "mink")


class MinkPeer:
    """The chain of joints from the base to the right palm as a model for mink, without collision volumes.

    mink ignores contacts.  Therefore `solve` takes a `Problem`, which checks whether the robot has contacts in the poses that mink finds.
    """

    def __init__(self, robot: Robot) -> None:
        self._mink = load_mink()
        model, self._motors = _chain(load_mujoco(), robot)
        self._configuration = self._mink.Configuration(model)
        self._task = self._mink.FrameTask("marker", "site", position_cost=1.0, orientation_cost=ORIENTATION_WEIGHT, lm_damping=MINK_DAMPING)
        self._limits = [self._mink.ConfigurationLimit(model)]

    def solve(self, problem: Problem, target: Target, seed: int, most: int) -> Array | None:
        """Return a pose (n,) rad within all tolerances, or None after `most` evaluations.

        It starts at home.  Each later start is alternately near home or uniform within the motors' limits, as in the library's least
        squares.  Steps of mink and contact checks are counted as evaluations.  `problem`: the inverse kinematics problem, which tests
        poses.  `target`: its target pose.  `seed`: of the random numbers.  `most`: largest number of evaluations.
        """
        rotation = self._mink.SO3.from_matrix(target.rotation)
        self._task.set_target(self._mink.SE3.from_rotation_and_translation(rotation, target.position))
        rng = np.random.default_rng(seed)
        low, high = problem.model.robot.limits[self._motors].T
        home = problem.start[self._motors]
        begin, starts = home, 0
        while problem.evaluations < most:
            starts += 1
            end = self._descend(problem, begin, target)
            if end is not None:
                q = problem.start.copy()
                q[self._motors] = np.clip(end, low, high)
                if problem.evaluate(q[None])[1][0]:
                    return q
            about = np.clip(home + NEAR * (high - low) * rng.standard_normal(len(home)), low, high)
            begin = about if starts % 2 else rng.uniform(low, high)
        return None

    def _descend(self, problem: Problem, begin: Array, target: Target) -> Array | None:
        """Take at most MINK_STEPS steps of differential inverse kinematics from the posture `begin`, (n,) rad.

        Returns the first posture that is near enough to the target: within STOP_SHARE of its tolerances.  None if there is none.
        """
        configuration, task = self._configuration, self._task
        configuration.update(begin)
        for _ in range(MINK_STEPS):
            error = task.compute_error(configuration)
            if np.linalg.norm(error[:3]) <= STOP_SHARE * target.metres and np.linalg.norm(error[3:]) <= STOP_SHARE * target.radians:
                found: Array = configuration.q
                return found
            problem.evaluations += 1
            try:
                velocity = self._mink.solve_ik(configuration, [task], 1.0, "daqp", limits=self._limits)
            except self._mink.NoSolutionFound:
                return None
            configuration.integrate_inplace(velocity, 1.0)
        return None


def _chain(mujoco: Any, robot: Robot) -> tuple[Any, list[int]]:
    """Return the MuJoCo model of the chain to the palm, and the motors of its joints, base first."""
    marker = robot.marker(MARKER)
    links: list[int] = []
    link = marker.link
    while link:
        links.insert(0, link)
        link = robot.joints[link - 1].parent
    matrix, offset = robot.coupling
    spec = mujoco.MjSpec()
    body, origin, motors = spec.worldbody, np.zeros(3), []
    for link in links:
        joint = robot.joints[link - 1]
        (drivers,) = np.nonzero(matrix[link - 1])
        if len(drivers) != 1 or matrix[link - 1, drivers[0]] != 1.0 or offset[link - 1] != 0.0:
            raise InvalidValue(f"joint {joint.name!r} is not moved by one motor alone, 1:1; the chain to {MARKER!r} must be.")
        motor = int(drivers[0])
        body = body.add_body(pos=joint.point - origin, mass=1.0, inertia=np.ones(3), explicitinertial=True)
        body.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis, limited=mujoco.mjtLimited.mjLIMITED_TRUE, range=robot.limits[motor]
        )
        origin = joint.point
        motors.append(motor)
    spec.compiler.degree = False
    turn = np.empty(4)
    mujoco.mju_mat2Quat(turn, np.ascontiguousarray(marker.rotation).reshape(9))
    body.add_site(name="marker", pos=marker.position - origin, quat=turn)
    return spec.compile(), motors
