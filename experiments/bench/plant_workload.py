"""What `mobee bench plant` runs: one arm on its lattice, and three curious agents at the table, as in the published experiments."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

import mobee
from mobee import Gains, Lattice, Model, OfflinePlant, ReachTarget, World
from mobee.robot.robot import Robot

SEED = 2014
DT = 0.02  # s, the published control period
TORSO = ("torso_yaw", "torso_roll", "torso_pitch")
LEFT = ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow")
RIGHT = tuple("r" + name[1:] for name in LEFT)
LEVELS = (0.2, 0.4, 0.6, 0.8)  # of the one arm: 256 states


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast something ran, in processor time of this process."""

    seconds: float  # processor time
    plant_seconds: float
    ticks: int
    ended: int  # actions or transitions

    @property
    def numbers(self) -> dict[str, float]:
        """For people and scripts."""
        return {
            "times_real_time": self.plant_seconds / self.seconds,
            "actions_per_second": self.ended / self.seconds,
            "us_per_tick": 1e6 * self.seconds / self.ticks,
            "seconds_per_action": self.plant_seconds / self.ended,
        }

    def standard(self, speed: float) -> dict[str, float]:
        """The rates on the standard machine, if this one had that speed (experiments/bench/calibration.py)."""
        return {f"standard_{key}": self.numbers[key] / speed for key in ("times_real_time", "actions_per_second")}


def robot() -> Robot:
    """The published model."""
    return mobee.load_robot("icub_2014")


def arm_plant(dt: float = DT, world: World | None = None, hashed: bool = False) -> OfflinePlant:
    """The left arm's four motors, the rest of the body rigid; published gains and motors, self collision."""
    return OfflinePlant(Model(robot(), world), SEED, Gains.published_2014(), dt=dt, active=LEFT, hashed=hashed)


def one_arm(plant: OfflinePlant, actions: int) -> Pace:
    """Random goals of the lattice, after a few that do not count."""
    space = Lattice(plant.robot, LEFT, LEVELS)
    goals = [space.target(int(state)) for state in np.random.default_rng(SEED).integers(len(space), size=actions + 5)]
    for goal in goals[:5]:
        plant.act("left_arm", goal)
    begin, start = plant.time, time.process_time()
    for goal in goals[5:]:
        plant.act("left_arm", goal)
    seconds = time.process_time() - start
    return Pace(seconds, plant.time - begin, round((plant.time - begin) / plant.dt), actions)


def one_arm_reaching(plant: OfflinePlant, reaches: int) -> Pace:
    """From random states of the lattice to random targets in front of the arm; the moves between them do not count."""
    space, rng = Lattice(plant.robot, LEFT, LEVELS), np.random.default_rng(SEED)
    seconds = time_reaching = 0.0
    for number in range(reaches + 5):
        plant.act("left_arm", space.target(int(rng.integers(len(space)))))
        plant.present(ReachTarget(rng.uniform((-0.4, -0.4, 0.0), (-0.1, 0.0, 0.4))))
        begin, start = plant.time, time.process_time()
        plant.reach("left_arm", "left_palm")
        if number >= 5:
            seconds += time.process_time() - start
            time_reaching += plant.time - begin
    return Pace(seconds, time_reaching, round(time_reaching / plant.dt), reaches)


def three_agents(transitions: int) -> Pace:
    """Torso, 27 states with 8 neighbours, and both arms, 81 with 16, at the table; curious, without a store."""
    plant = OfflinePlant(Model(robot(), mobee.load_world("table")), SEED, Gains.published_2014(), dt=DT, active=(*TORSO, *LEFT, *RIGHT))
    spaces = [Lattice(plant.robot, motors, neighbours=count) for motors, count in ((TORSO, 8), (LEFT, 16), (RIGHT, 16))]
    agents = [mobee.CuriousAgent(space, plant, seed=SEED) for space in spaces]
    mobee.run(agents, 30)
    begin, start = plant.time, time.process_time()
    mobee.run(agents, transitions)
    seconds = time.process_time() - start
    return Pace(seconds, plant.time - begin, round((plant.time - begin) / plant.dt), transitions)


def trajectory_hash(actions: int) -> str:
    """The hash of a new plant's trajectory."""
    plant = arm_plant(hashed=True)
    one_arm(plant, actions)
    return plant.hash
