"""MuJoCo's stepper on the plant's model: the same tree, fields and tested links, velocity servos, steps as long as our substeps."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from experiments.bench.mujoco_peer import MujocoPeer
from mobee.robot.robot import LinkPair, Robot
from mobee.simulation import MotorParameters, OfflinePlant
from mobee.simulation.rigid import stiffened

GAIN = 20.0  # N m s/rad of the servos, on bodies of 1 kg and 1 kg m^2
PERIOD = 50  # ticks between two commands


def us_per_tick(plant: OfflinePlant, ticks: int, seed: int = 0) -> float:
    """Processor time [us] of a control tick's worth of steps, while random velocities are asked for."""
    alive = np.isin(np.arange(len(plant.robot.motors)), plant.motors.living)
    robot = stiffened(plant.robot, alive, solids=False)
    peer = MujocoPeer(replace(robot, untested=_untested(robot)), plant.model.world.objects, servo=GAIN)
    substeps = MotorParameters().substeps(plant.dt)
    peer.model.opt.timestep = plant.dt / substeps
    rng, spent = np.random.default_rng(seed), 0.0
    for _ in range(ticks // PERIOD):
        peer.data.ctrl[:] = rng.uniform(-0.5, 0.5, peer.model.nu)
        start = time.process_time()
        peer.step(PERIOD * substeps)
        spent += time.process_time() - start
    return 1e6 * spent / (ticks // PERIOD * PERIOD)


def _untested(robot: Robot) -> dict[LinkPair, str]:
    """Links of which no two shapes are tested."""
    link = [shape.link for shape in robot.shapes]
    tested = {frozenset((link[i], link[j])) for i, j in robot.field_pairs.tolist()}
    links = range(len(robot.links))
    return {frozenset((i, j)): "no pair" for i in links for j in range(i) if frozenset((i, j)) not in tested}
