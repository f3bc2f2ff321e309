# SPDX-License-Identifier: Apache-2.0
"""Gymnasium both ways: the robot as an environment for any agent, and any discrete environment for the curious agent."""

from __future__ import annotations

import gymnasium

import mobee
import mobee.gymnasium  # registers the environments
from mobee.gymnasium import EnvPlant

# The robot is the environment.  A step moves the arm until it has settled; info holds the true outcome.
env = gymnasium.make("MoBeE/Lattice-v0", reward="gain")
state, info = env.reset(seed=0)
env.action_space.seed(0)
for _ in range(5):
    action = env.action_space.sample(info["action_mask"])
    state, gain, _, _, info = env.step(action)
    print(f"state {state:2d} after {info['duration']:.1f} s, touching {', '.join(info['touched']) or 'nothing'}: gained {gain:.4f} nats")

# The environment is the robot: the curious agent explores it, and plans to its goal with what it has learned.
for explorer in ("random", "curious"):
    plant = EnvPlant(gymnasium.make("CliffWalking-v1"), seed=0)
    agent = mobee.CuriousAgent(plant.space, plant, explorer, beliefs="debiased")
    agent.run(400)
    print(f"{explorer}: tried {(agent.model.tries > 0).sum()} of 152 state-actions that can be reached, in {len(plant.returns)} episodes")
plan = mobee.Planner(plant.space, agent.model.debiased(), [47]).plan(36)
print(f"a path along the cliff: {' -> '.join(map(str, plan.path))}")
