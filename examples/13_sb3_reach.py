# SPDX-License-Identifier: Apache-2.0
"""An agent of Stable-Baselines3 learns to reach: SAC with hindsight experience replay on MoBeE/Reach-v0, here with steps of half a second.

Needs `pip install stable-baselines3`.  The controller keeps the arm from collisions under all actions of the agent: the reports give the
depth of the deepest contact of solids so far.  An argument gives the number of steps to train.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3 import SAC, HerReplayBuffer

import mobee.gymnasium

gymnasium.register_envs(mobee.gymnasium)

STEPS = int(sys.argv[1]) if len(sys.argv) > 1 else 14_000
EVERY, EPISODES, LENGTH = 1000, 50, 20
TASK = {"period": 0.5, "step": 0.4}  # s, rad


class Watched(gymnasium.Wrapper):
    """Keeps in `deepest` the depth of the deepest contact of solids (bodies of robot and objects) in all steps so far [m]."""

    deepest = 0.0

    def step(self, action: np.ndarray) -> Any:
        """Perform one step, and note the deepest contact."""
        result = self.env.step(action)
        self.deepest = max(self.deepest, result[4]["solid_depth"])
        return result


def success(agent: SAC) -> float:
    """Return the share of test episodes (all at once, each with its own goal) that end with the palm at the goal."""
    test = gymnasium.make_vec("MoBeE/Reach-v0", num_envs=EPISODES, **TASK)
    seen, info = test.reset(seed=10_000)
    for _ in range(LENGTH):
        seen, _, _, _, info = test.step(agent.predict(seen, deterministic=True)[0])
    return float(info["is_success"].mean())


env = Watched(gymnasium.make("MoBeE/Reach-v0", max_episode_steps=LENGTH, **TASK))
agent = SAC(
    "MultiInputPolicy", env, policy_kwargs={"net_arch": [64, 64]}, batch_size=128, gamma=0.9, ent_coef=0.02, learning_rate=1e-3,
    learning_starts=500, seed=0, replay_buffer_class=HerReplayBuffer, replay_buffer_kwargs={"n_sampled_goal": 4},
)  # fmt: skip
start = time.process_time()
print(f"{0:6d} steps: success {success(agent):.2f}")
for trained in range(EVERY, STEPS + 1, EVERY):
    agent.learn(EVERY, reset_num_timesteps=False)
    rate, seconds = success(agent), time.process_time() - start
    print(
        f"{trained:6d} steps: success {rate:.2f}, {seconds:3.0f} s of processor time, deepest contact {1000 * env.deepest:.2f} mm",
        flush=True,
    )
