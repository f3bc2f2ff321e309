# SPDX-License-Identifier: Apache-2.0
"""A curious agent learns the outcomes of its actions, stores each on disk, and continues after a restart.

States are cells around 27 poses of the torso, actions go towards a neighbouring pose. Each outcome is rewarded by how much
it changed the agent's transition model; from these rewards, value iteration computes the next action (thesis chapter 6).
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import mobee
from mobee.store import TransitionStore

robot = mobee.load_robot("icub")
space = mobee.Lattice(robot, joints=["torso_yaw", "torso_roll", "torso_pitch"], levels=(0.25, 0.5, 0.75), neighbours=8)
print(space)


def agent_on(store: TransitionStore) -> mobee.CuriousAgent:
    """Return a new agent that continues from the transitions in the store; it acts on an offline robot at its home posture."""
    plant = mobee.OfflinePlant(mobee.Model(robot, mobee.load_world("table")), seed=0)
    return mobee.CuriousAgent(space, plant, explorer="curious", seed=0, store=store)


with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "transitions.sqlite"

    with TransitionStore(file, "torso") as store:  # each transition is on disk before the agent acts again
        agent = agent_on(store)
        for _ in range(10):
            reward = agent.step()
            made = agent.last
            goal = space.goal(made.s, made.a)
            surprise = "" if made.s_next == goal else f", which is not {goal}"
            print(f"  {made.n:2d}: from {made.s:2d} towards {goal:2d}, got to {made.s_next:2d}{surprise}: gained {reward:.4f} nats")

    print("the process may end here, even by kill -9")

    with TransitionStore(file, "torso") as store:
        agent = agent_on(store)
        print(f"a new one finds {agent.transitions} transitions")
        agent.run(10)
        print(f"and has made {agent.transitions} in all, {(agent.model.tries > 0).sum()} different state-actions of {space.state_actions}")

        surprising = next(made for made in store.load() if made.s_next != space.goal(made.s, made.a))
        states, counts = agent.model.bins(surprising.s, surprising.a)
        believed = ", ".join(f"{100 * share:.0f} % state {state}" for state, share in zip(states, counts / counts.sum(), strict=True))
        print(f"towards {space.goal(surprising.s, surprising.a)} from {surprising.s} it now expects: {believed}")
