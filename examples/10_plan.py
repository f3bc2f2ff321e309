# SPDX-License-Identifier: Apache-2.0
"""The transition model that curiosity has learned is a planner from any state to any other (thesis 6.5, 7.4.1).

The cables of the shoulder keep the arm from some poses. The model of the robot has no cables, but the agent has learned their effect by
trying. A planner without experience expects that every action reaches its goal with the same probability, and its plans fail there. A
planner that uses the observed outcomes avoids these transitions.
"""

from __future__ import annotations

import mobee

ARM = ["l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"]
START, TARGET = 63, 24  # in state 24 the cables pull hardest: pitch low, roll and yaw high
TRIES, PATIENCE = 5, 25  # number of walks, and largest number of actions of a walk

robot = mobee.load_robot("icub_2014")
model = mobee.Model(robot)
plant = mobee.OfflinePlant(model, 0, mobee.Gains.published_2014(), dt=0.02, active=ARM)
space = mobee.Lattice(robot, joints=ARM, neighbours="equidistant")
agent = mobee.CuriousAgent(space, plant)
agent.run(1300)
least = agent.model.tries[space.goals >= 0].min()
print(f"{agent.transitions} transitions: each of {space.state_actions} state-actions was tried at least {least} times")


def walk(planner: mobee.Planner) -> int:
    """Perform the planned action in each state until a target is reached; return the number of actions.

    If no target is reached by PATIENCE actions, the walk ends and PATIENCE is returned.
    """
    state = space.state_of(plant.measure(space.part))
    for taken in range(PATIENCE):
        if state in planner.targets:
            return taken
        goal = space.goal(state, int(planner.policy[state]))
        state = space.state_of(plant.act(space.part, space.target(goal)).q)
    return PATIENCE


learned = agent.model.debiased()  # without the failures that curiosity imagines
naive = mobee.TransitionModel(space).debiased()  # the beliefs of an agent without experience
for name, beliefs in (("naive", naive), ("learned", learned)):
    planner = mobee.Planner(space, beliefs, [TARGET])
    plan = planner.plan(START)
    print(f"\n{name}: {' -> '.join(map(str, plan.path))}, as expected with probability {plan.success:.2f}")
    for (state, goal), chance in plan.distrusted.items():
        print(f"  not {state} -> {goal}, which works with probability {chance:.2f}")
    taken = []
    for _ in range(TRIES):
        walk(mobee.Planner(space, learned, [START]))
        taken.append(walk(planner))
    print(f"  on the robot it took {', '.join(map(str, taken))} actions")

print("\nfrom anywhere:")
planner = mobee.Planner(space, learned, [TARGET])
for start in (0, 40, 60, 80):
    plan = planner.plan(start)
    print(f"  {' -> '.join(map(str, plan.path))}: {plan.success:.2f}; avoided: {', '.join(map(str, plan.avoided)) or 'nothing'}")
