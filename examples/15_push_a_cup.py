# SPDX-License-Identifier: Apache-2.0
"""A curious agent learns which of its actions move a cup, and then pushes the cup to a chosen cell of the table.

Two joints of the left arm sweep the hand over the table and lift it. A state of the agent is a posture together with the cell in which the
cup is perceived. Explorer, transition model and planner are those of the other examples. Offline a quasi-static model computes how the hand
pushes the cup; on a live robot, the function `see` would return the position that vision publishes.
"""

from __future__ import annotations

import numpy as np

import mobee

ARM = ["l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"]
PLACE = (-0.31, -0.15, -0.055)  # m, where the cup stands at first
ACTIONS, TARGET, TRIES, PATIENCE = 1500, 0, 8, 12

robot = mobee.load_robot("icub")
world = mobee.load_world("table")
world.remove("ball")
world.add("cup", mobee.cylinder(0.035, 0.09), position=PLACE, role="ghost")  # a ghost does not repel the hand
plant = mobee.OfflinePlant(mobee.Model(robot, world), seed=0, dt=0.02, active=ARM)
cup = mobee.SlidingObject(plant, "cup", friction=0.3, area=((-0.37, -0.23), (-0.24, 0.0)))

low, high = robot.limits[robot.parts["left_arm"].slice].T
rest = (robot.home[robot.parts["left_arm"].slice] - low) / (high - low)
rest[:2] = 0.75, 0.05  # shoulder pitch and roll, with which the hand is low above the table
sweep = {"l_shoulder_yaw": (0.0, 0.12, 0.24, 0.36, 0.48, 0.6), "l_elbow": (0.6, 0.8)}
postures = mobee.Lattice(robot, list(sweep), sweep, neighbours="equidistant", rest=rest.tolist())
cells = mobee.Grid(x=(-0.37, -0.23), y=(-0.24, 0.0), shape=(1, 4))
space = mobee.ObjectSpace(postures, cells, "cup")
START = cells.cell_of(PLACE)

errors = np.random.default_rng(0)


def see() -> dict[str, np.ndarray]:
    """Return a dict from the name "cup" to its position (3,) m, root frame, as cameras would perceive it; an empty dict after a fall.

    A normal error with a standard deviation of 3 mm is added to each coordinate.
    """
    return {name: place + errors.normal(0.0, 0.003, 3) for name, place in cup.perceive().items()}


perceiving = mobee.PerceivingPlant(plant, see)
agent = mobee.CuriousAgent(space, perceiving, detector="run_length")
agent.run(ACTIONS)
print(f"{space}\nin {ACTIONS} actions the cup was pushed {cup.path:.2f} m and fell {cup.falls} times")

beliefs = agent.model.debiased()
leaves = np.where(space.cells[beliefs.outcomes] != space.cells[:, None, None], beliefs.probabilities, 0.0).sum(axis=-1)
leaves[agent.model.tries < 5] = 0.0
for number in np.argsort(-leaves, axis=None)[:5].tolist():
    state, action = divmod(number, leaves.shape[1])
    goal = space.posture(space.goal(state, action))
    chance = leaves[state, action]
    print(f"  cup in cell {space.cell(state)}: posture {space.posture(state)} -> {goal} moves it with probability {chance:.2f}")


def pushes(target: int, plan: bool) -> int:
    """Try TRIES times to push the cup from its first place to the cell `target`; return the number of tries that succeed.

    A try has at most PATIENCE actions. `plan`: whether a plan chooses them; otherwise they are random.
    """
    planner, reached = mobee.Planner(space, beliefs, space.in_cell(target)), 0
    for _ in range(TRIES):
        plant.act("left_arm", postures.target(11))  # aside and lifted
        cup.put_back()
        state = space.state(11, START)
        for _ in range(PATIENCE):
            action = int(planner.policy[state]) if plan else int(errors.integers(len(space.actions(state))))
            state = space.state_after(perceiving.act("left_arm", space.aim(state, action)), state)
            if space.cell(state) == target:
                reached += 1
                break
    return reached


planned, drawn = pushes(TARGET, plan=True), pushes(TARGET, plan=False)
print(f"from cell {START} to cell {TARGET}, of {TRIES} tries: {planned} by plans, {drawn} by random actions")
