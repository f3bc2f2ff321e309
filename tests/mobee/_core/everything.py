# SPDX-License-Identifier: Apache-2.0
"""What every compiled part of the library answers to the same questions, as hashes: `python -m tests.mobee._core.everything`.

Run with $MOBEE_CORE it prints the answers of one build of the core; all builds are to give the same bits.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable

import numpy as np

import mobee
from mobee._core.learning import gaussian_sums
from mobee.learning.reaching.histories import Histories
from mobee.learning.tabular import TabularPlant, half_space
from mobee.rendering.scene import Scene, clutter, room
from mobee.roadmap.edges import check_edges
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.solve import Descent
from mobee.robot.load import Robot
from mobee.vision.imperfections import Cameras, CameraSettings, camera_errors
from mobee.vision.objects.detectors import detector_of
from mobee.vision.objects.thing import things_in

ARM = ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow")


def digest(*arrays: object) -> str:
    """Of all bits of some numbers."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:16]


def poses_of(robot: Robot, count: int, seed: int) -> np.ndarray:
    """Poses within the limits, some far beyond, where angles are reduced otherwise."""
    q = np.random.default_rng(seed).uniform(*robot.limits.T, (count, len(robot.motors)))
    q[-1] += 1e6
    return q


def evaluation() -> str:
    """Places, contacts and torques, of a batch and of single poses."""
    robot, world = mobee.load_robot("icub"), mobee.load_world("table")
    world.add("tin", mobee.cylinder(0.1, 0.03), position=(-0.25, 0.1, 0.05))
    world.add("crate", mobee.box(0.2, 0.1, 0.1), position=(-0.2, -0.2, 0.1))
    model, q = mobee.Model(robot, world), poses_of(robot, 60, seed=1)
    parts = []
    for pose in (model.evaluate(q), *(model.evaluate(one) for one in q[:10])):
        parts += [pose.transforms, pose.table.numbers, pose.table.reals, pose.projection]
    return digest(*parts)


def jacobians() -> str:
    """Of a hand."""
    robot = mobee.load_robot("icub")
    return digest(mobee.Model(robot).jacobian(poses_of(robot, 20, seed=2), "left_palm"))


def control() -> str:
    """Steps of the controller, into the table."""
    robot = mobee.load_robot("icub")
    controller = mobee.Controller(mobee.Model(robot, mobee.load_world("table")))
    controller.attractor = robot.home + 0.4
    q, parts = robot.home.copy(), []
    for _ in range(40):
        command = controller.step(q, dt=0.01)
        q = command.position
        parts += [command.position, command.velocity, command.torque]
    return digest(*parts)


def plant() -> str:
    """Two actions of an arm with motors that lag and slip."""
    robot = mobee.load_robot("icub")
    space = mobee.Lattice(robot, joints=list(ARM))
    acting = mobee.OfflinePlant(mobee.Model(robot, mobee.load_world("table")), seed=3, hashed=True)
    outcomes = [acting.act("left_arm", space.target(state)) for state in (40, 12)]
    return digest(*(outcome.q for outcome in outcomes)) + acting.hash


def planning() -> str:
    """Value iteration on a model that has seen some transitions."""
    space = mobee.Lattice(mobee.load_robot("icub"), joints=list(ARM))
    learned, rng = mobee.TransitionModel(space, initial="50-50"), np.random.default_rng(4)
    for _ in range(300):
        state = int(rng.integers(len(space.samples)))
        learned.observe(state, int(rng.integers(len(space.actions(state)))), int(rng.integers(len(space.samples))))
    return digest(*mobee.value_iteration(learned, learned.reward, discount=0.9, tolerance=1e-3))


def inverse_kinematics() -> str:
    """A pose with the palm in a place, found by least squares."""
    robot = mobee.load_robot("icub")
    model = mobee.Model(robot, mobee.load_world("table"))
    costs = [mobee.costs.position("left_palm", (-0.3, 0.2, 0.15)), mobee.costs.collision()]
    found = mobee.solve_ik(model, costs, start=robot.home, seed=5)
    return digest(found.q, list(found.residuals.values()))


def least_squares() -> str:
    """Where many starts lead to, in threads."""
    robot = mobee.load_robot("icub")
    costs = [mobee.costs.position("left_palm", (-0.3, 0.2, 0.15)), mobee.costs.palm_to_palm(), mobee.costs.gaze("left_palm")]
    problem = Problem(mobee.Model(robot), costs, None, None)
    starts = np.random.default_rng(7).uniform(*robot.limits.T, (30, len(robot.motors)))
    return digest(*Descent(problem, threads=3).ends(starts))


def exploring() -> str:
    """An agent that follows its plans, of actions that fail now and then."""
    space = mobee.Lattice(mobee.load_robot("icub"), joints=list(ARM))
    agent = mobee.CuriousAgent(space, TabularPlant(space, *half_space(space), seed=8), "depleting")
    agent.run(150)
    return digest(agent.model.counts, *agent.plan())


def histories() -> str:
    """Weighted and Gaussian sums."""
    rng = np.random.default_rng(9)
    known = Histories(4, 0.01)
    for _ in range(50):
        known.add(int(rng.integers(4)), rng.normal(size=3), float(rng.normal()))
    sums = np.zeros((2, 30))
    gaussian_sums(rng.normal(size=(30, 5)), rng.normal(size=(40, 6)), sums)
    return digest(known.average(np.zeros(3), 1.0), sums)


def edges() -> str:
    """Which straight motions are free."""
    robot = mobee.load_robot("icub")
    q = poses_of(robot, 12, seed=6)[:-1]
    return digest(check_edges(mobee.Model(robot, mobee.load_world("table")), q, np.array([(i, i + 1) for i in range(10)]), 0.1))


def pictures() -> str:
    """What an eye sees of a room, and an imperfect one of it, and the red things in it."""
    robot, world = mobee.load_robot("icub"), mobee.load_world("table")
    scene = Scene(robot, world, around=[*room(10), *clutter(world.objects.values(), 10)])
    settings = CameraSettings(samples=2)
    eyes = Cameras(scene, settings, camera_errors(settings, robot, list(scene.cameras), seed=10), seed=10)
    picture = eyes.expose("right", [robot.home, robot.home + 0.01])
    red = [one.outline for one in detector_of("color", things_in(world))(picture)]
    return digest(scene.draw("left"), picture, *red)


PARTS: tuple[Callable[[], str], ...] = (
    evaluation,
    jacobians,
    control,
    plant,
    planning,
    inverse_kinematics,
    least_squares,
    exploring,
    histories,
    edges,
    pictures,
)

if __name__ == "__main__":
    print(json.dumps({part.__name__: part() for part in PARTS}))
