# SPDX-License-Identifier: Apache-2.0
"""Write your own agent: a class that decides, acts through a plant, and observes.

This one is not curious: it goes to the state that it visited least, and counts its arrivals. It uses the lattice, the
transition model and the plant, and it would run on the live robot unchanged.
"""

from __future__ import annotations

import numpy as np

import mobee


class Wanderer:
    """An agent that moves from its state to the neighbouring state that it has visited least; it chooses at random among equals."""

    def __init__(self, space: mobee.Lattice, plant: mobee.Plant, seed: int = 0) -> None:
        self.space, self.plant = space, plant
        self.model = mobee.TransitionModel(space)
        self.rng = np.random.default_rng(seed)
        self.state = space.state_of(plant.measure(space.part))
        self.visits = np.zeros(len(space), dtype=int)

    def decide(self, state: int) -> int:
        """Return the next action in a state, as an index into space.actions(state)."""
        visits = self.visits[self.space.actions(state)]
        return int(self.rng.choice(np.flatnonzero(visits == visits.min())))

    def observe(self, state: int, action: int, outcome: mobee.Outcome) -> float:
        """Learn from the outcome of the action; returns the information gain in nats."""
        self.state = self.space.state_of(outcome.q)
        self.visits[self.state] += 1
        return self.model.observe(state, action, self.state)

    def step(self) -> float:
        """Decide, act and observe once; return the information gain of the observation in nats."""
        state = self.state
        action = self.decide(state)
        outcome = self.plant.act(self.space.part, self.space.target(self.space.goal(state, action)))
        return self.observe(state, action, outcome)


robot = mobee.load_robot("icub")
plant = mobee.OfflinePlant(mobee.Model(robot, mobee.load_world("table")), seed=0)
space = mobee.Lattice(robot, joints=["l_shoulder_pitch", "l_elbow"], neighbours="equidistant")
agent = Wanderer(space, plant)
print(f"{space}; it starts in state {agent.state}")

for n in range(1, 13):
    gain = agent.step()
    print(f"  {n:2d}: now in state {agent.state}, gained {gain:.4f} nats")

print("visits, shoulder pitch from left to right, elbow from top to bottom:")
print(agent.visits.reshape(3, 3))
