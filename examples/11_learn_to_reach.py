# SPDX-License-Identifier: Apache-2.0
"""Learn from which pose to reach for each target: a coarse plan, then a reach that closes the remaining distance (thesis chapter 8).

Each position is a problem. The reward of a reach for one target informs about the others, so that a position never tried before
is reached from a good pose, too.
"""

from __future__ import annotations

import numpy as np

import mobee

ARM = ["r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow"]
LOW = [(-0.3, 0.0, 0.0), (-0.3, 0.2, 0.0), (-0.3, 0.0, 0.2), (-0.3, 0.2, 0.2)]  # m, root frame: in front of the robot
OTHERS = [(-0.2, 0.0, 0.4), (-0.2, 0.2, 0.4), (-0.2, 0.4, 0.0), (-0.2, 0.4, 0.2)]  # above, and at its side

robot = mobee.load_robot("icub")
plant = mobee.OfflinePlant(mobee.Model(robot), 0, active=ARM)
space = mobee.Lattice(robot, joints=ARM)
targets = [mobee.ReachTarget(np.array(place)) for place in LOW + OTHERS]

agent = mobee.ReachAgent(space, plant, marker="right_palm", predictor="gp", strategy="ucb", failures="local")
for _ in range(3):
    agent.learn(targets, tries=40)
    found = agent.evaluate(targets, repetitions=2)  # from random poses; nothing is learned from it
    print(f"after {agent.tries} tries: {found.scores.mean():.2f} of {len(targets)}; {100 * np.nanmedian(found.missing):.1f} cm remain")

new = mobee.ReachTarget(np.array((-0.3, 0.1, 0.15)))
plan = agent.plan(new)
print(f"a new target: {' -> '.join(map(str, plan.path))}, then reach; expected reward {plan.expected:.2f}")
made = agent.try_problem(new)
print(f"reached from state {made.reach_state}: {1000 * made.missing:.1f} mm remain, reward {made.reward:.2f}")
