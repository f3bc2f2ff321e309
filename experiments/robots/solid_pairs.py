# SPDX-License-Identifier: Apache-2.0
"""Write services/robot_sim/solid_pairs.json: which pairs of links count as solid contact in the simulator.

A pair is listed if the convex hulls of its links stay apart by 2 mm in 2000 random legal poses (within the joint limits and the robot's
linear constraints).  If a pair overlaps in some of these poses (shoulder and chest, forearm and hand), its contacts are no sign of a
collision.  Hands and forearms against torso, head, table and the other arm are always listed: the robot must avoid these contacts, and they
occur in many random poses.

Run time: about 2 s.  Usage: python -m experiments.robots.solid_pairs
"""

from __future__ import annotations

from itertools import combinations

import msgspec
import numpy as np

from mobee.arrays import Array
from mobee.model.world_file import load_world
from mobee.robot.icub_urdf import MODEL
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from services.robot_sim.bullet_scene import SOLID_PAIRS, TABLE, BulletScene, SolidPairs

MIN_DISTANCE = 0.002  # m
POSES = 2000
SEED = 2014
TORSO_AND_HEAD = ("root_link", "torso_1", "torso_2", "chest", "neck_1", "neck_2", "head")
ARM = ("shoulder_1", "shoulder_2", "shoulder_3", "upper_arm", "elbow_1", "forearm", "wrist_1", "hand")


def always() -> list[list[str]]:
    """Return the pairs of link names that count as solid contact in any case, without a test of poses.

    They are hands and forearms against torso, head, the other arm and the table.
    """
    pairs = set()
    for side, other in (("l", "r"), ("r", "l")):
        for link in (f"{side}_forearm", f"{side}_hand"):
            for against in (*TORSO_AND_HEAD, *(f"{other}_{part}" for part in ARM), TABLE):
                pairs.add((min(link, against), max(link, against)))
    return [list(pair) for pair in sorted(pairs)]


def legal_poses(robot: Robot, rng: np.random.Generator, count: int) -> list[Array]:
    """Return `count` random poses (n,) rad, uniform within the limits, that satisfy every clause.

    A clause is a condition on several motor positions, as the shoulder's cables impose.
    """
    lower, upper = robot.limits[:, 0], robot.limits[:, 1]
    poses: list[Array] = []
    while len(poses) < count:
        q = rng.uniform(lower, upper)
        if all((clause.a @ q + clause.b > 0.0).any() for clause in robot.clauses):
            poses.append(q)
    return poses


def stay_apart(scene: BulletScene, pairs: list[list[str]], poses: list[Array]) -> list[list[str]]:
    """Return which of the pairs of link names have hulls more than 2 mm apart in all poses; `poses`: (n,) rad each."""
    for q in poses:
        scene.set_posture(q)
        pairs = [pair for pair in pairs if scene.distance(pair[0], pair[1], MIN_DISTANCE) > MIN_DISTANCE]
    return pairs


def main() -> None:
    """Write solid_pairs.json, the pairs of links that count as solid contact in the simulator, and print how many pairs it has."""
    robot, world = load_robot("icub"), load_world("table")
    scene = BulletScene(robot, world, substep=0.005)
    solid = sorted(name for name in scene.links if not name.endswith("_dh_frame"))
    listed = always()
    others = [list(pair) for pair in combinations(solid, 2)] + [[link, TABLE] for link in solid if link != "root_link"]
    poses = legal_poses(robot, np.random.default_rng(SEED), POSES)
    apart = stay_apart(scene, [pair for pair in others if sorted(pair) not in listed], poses)
    scene.close()
    result = SolidPairs(model=MODEL, distance=MIN_DISTANCE, poses=POSES, seed=SEED, always=listed, apart=apart)
    SOLID_PAIRS.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=1) + b"\n")
    print(f"{len(listed)} pairs always, {len(apart)} of {len(others)} stay apart; written to {SOLID_PAIRS}")


if __name__ == "__main__":
    main()
