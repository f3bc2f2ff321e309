# SPDX-License-Identifier: Apache-2.0
"""The cup experiment's agent that learns, on an offline plant (a robot simulated in one process), to bring the palm beside a cup."""

from __future__ import annotations

import time
from functools import cache

import numpy as np

from experiments.kit.cup.approaches import ready, robot
from experiments.kit.cup.scene import FAR, HEIGHT, NEAR, RADIUS, TOP, table
from experiments.kit.physics_plant import PhysicsPlant
from mobee import Lattice, Model, OfflinePlant, ReachAgent, ReachTarget
from mobee.behaviours.grasp import Grip, palm_beside
from mobee.behaviours.pick import Upright, azimuth_beside
from mobee.behaviours.pre_grasp import MARKER, PART, Approach
from mobee.roadmap.playback import standing

JOINTS = ("r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow")
LEVELS = (0.15, 0.4, 0.65)  # of the ranges
PROBLEMS, TRIES = 40, 300
SMALL = 0.01  # m, radius of the target, which stands for the place of the palm


@cache
def learner() -> ReachAgent:
    """Return the agent, which has learned to reach beside cups at random places of an empty table.

    The agent's states are postures on a lattice of four arm joints.  Only these joints move; torso, wrist and hand stay in the posture in
    which a trial begins.  Every call returns the same object.
    """
    body = standing(robot(), ready())
    where = body.part(PART).slice
    low, high = body.limits[where].T
    space = Lattice(body, JOINTS, LEVELS, 16, rest=(ready()[where] - low) / (high - low))
    plant = OfflinePlant(Model(body, table()), 0, active=[PART])
    found = ReachAgent(space, plant, marker=MARKER, predictor="gp", strategy="ucb", failures="alike", seed=0)
    rng = np.random.default_rng([0, 436])
    found.learn([_target(Upright(place, RADIUS, HEIGHT, TOP)) for place in rng.uniform(NEAR, FAR, (PROBLEMS, 2))], TRIES)
    return found


def by_learner(plant: PhysicsPlant, thing: Upright) -> Approach:
    """Bring the palm beside the cup `thing` by a plan of the agent that `learner` returns, and return the result as `Approach`.

    The result always has 1 plan, and 0 bumps (unplanned contacts of the arm), because bumps are not detected here.  The arm moves through
    the states of the agent's plan; then a reach follows, in which a force pulls the palm to its place beside the cup.  The agent learns
    nothing from this.  The returned azimuth, the direction that the palm faces, is the planned one, even if the palm did not arrive.
    """
    agent, target = learner(), _target(thing)
    begun = time.process_time()
    state = agent.space.state_of(plant.measure(PART))
    planned = agent.plan(target, state)
    planning = time.process_time() - begun
    plant.exempt = None
    plant.present(target)
    for passed in planned.path[1:]:
        plant.act(PART, agent.space.target(passed))
    plant.reach(PART, MARKER, stay=True)
    plant.present(None)
    plant.exempt = MARKER
    return Approach(azimuth_beside(thing.place), 0, 1, planning)


def _target(thing: Upright) -> ReachTarget:
    """Return the reach that brings the palm to its place beside the thing, facing it."""
    azimuth, grip = azimuth_beside(thing.place), Grip()
    palm = palm_beside(thing.place, thing.radius, azimuth, grip.before, thing.ground, grip)
    return ReachTarget(palm.position, SMALL, "centre", palm.rotation[:, 2])
