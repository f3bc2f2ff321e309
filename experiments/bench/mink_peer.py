"""mink (differential inverse kinematics on MuJoCo, by quadratic programs) with restarts and our contact check, on the same problems."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.bench.ik_workload import MARKER, Target
from experiments.bench.mujoco_peer import load_mujoco
from mobee.arrays import Array
from mobee.errors import InvalidValue, MobeeError
from mobee.roadmap.ik.least_squares import NEAR
from mobee.roadmap.ik.problem import Problem
from mobee.robot.robot import Robot

# Its best among 0 to 10, 12 to 60 and 0.1 to 0.4.
DAMPING = 1.0  # of Levenberg-Marquardt
STEPS = 12  # of one start
ARM = 0.4  # m/rad: how an angle weighs beside a length
NEAR_ENOUGH = 0.9  # of the tolerances: it stops there


class MinkMissing(MobeeError):
    """Raised when the benchmark is asked for and mink is not installed."""


def load_mink() -> Any:
    """The package mink; raises MinkMissing."""
    try:
        import mink
    except ImportError:
        raise MinkMissing("mink is not installed: pip install '.[bench]' in MoBeE's folder") from None
    return mink


class MinkPeer:
    """The chain from the base to the palm, without volumes: contacts are looked for by the problem, in poses that are there."""

    def __init__(self, robot: Robot) -> None:
        self._mink = load_mink()
        model, self._motors = _chain(load_mujoco(), robot)
        self._configuration = self._mink.Configuration(model)
        self._task = self._mink.FrameTask("marker", "site", position_cost=1.0, orientation_cost=ARM, lm_damping=DAMPING)
        self._limits = [self._mink.ConfigurationLimit(model)]

    def solve(self, problem: Problem, target: Target, seed: int, most: int) -> Array | None:
        """A pose (n,) within all tolerances, begun as our least squares: at home, then in turn about home and anywhere.

        Steps count as evaluations, and so do poses that are looked at for contacts; None where they come to `most` before.
        """
        rotation = self._mink.SO3.from_matrix(target.rotation)
        self._task.set_target(self._mink.SE3.from_rotation_and_translation(rotation, target.place))
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
                if problem.look(q[None])[1][0]:
                    return q
            about = np.clip(home + NEAR * (high - low) * rng.standard_normal(len(home)), low, high)
            begin = about if starts % 2 else rng.uniform(low, high)
        return None

    def _descend(self, problem: Problem, begin: Array, target: Target) -> Array | None:
        """Where it leads, if that is near enough."""
        configuration, task = self._configuration, self._task
        configuration.update(begin)
        for _ in range(STEPS):
            error = task.compute_error(configuration)
            if np.linalg.norm(error[:3]) <= NEAR_ENOUGH * target.metres and np.linalg.norm(error[3:]) <= NEAR_ENOUGH * target.radians:
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
    """Its MuJoCo model, and the motors of its joints, base first."""
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
