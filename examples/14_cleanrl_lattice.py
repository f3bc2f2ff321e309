# SPDX-License-Identifier: Apache-2.0
"""Q-learning in one file and in NumPy alone, in the style of CleanRL: the arm learns to bring its hand to a state of its lattice.

Eight robots act at once.  The value of each action of a state begins at 1, so that each is tried.
"""

from __future__ import annotations

from dataclasses import dataclass

import gymnasium
import numpy as np

import mobee.gymnasium

gymnasium.register_envs(mobee.gymnasium)


@dataclass
class Arguments:
    """Settings of the environments, of Q-learning and of its exploration.

    `goal`: number of the goal state. `num_envs`: number of robots. `total_steps`: steps of all robots together. `learning_rate`, `gamma`
    (discount factor), `epsilon` (probability of a random action): as in Q-learning.
    """

    goal: int = 7
    num_envs: int = 8
    episode: int = 25  # steps at most
    total_steps: int = 3000
    learning_rate: float = 0.5
    gamma: float = 0.9
    epsilon: float = 0.05
    seed: int = 1


args = Arguments()
rng = np.random.default_rng(args.seed)
envs = gymnasium.make_vec("MoBeE/Lattice-v0", num_envs=args.num_envs, max_episode_steps=args.episode, goal=args.goal, neighbours=8)
q = np.ones((envs.single_observation_space.n, envs.single_action_space.n))

state, info = envs.reset(seed=args.seed)
begun = np.zeros(args.num_envs, dtype=bool)  # a step after the end of an episode begins a new one, and is no transition
lengths, length = [], np.zeros(args.num_envs, dtype=int)
reached: list[bool] = []
for step in range(args.total_steps // args.num_envs):
    allowed = info["action_mask"] > 0
    greedy = np.where(allowed, q[state] + 1e-6 * rng.random(q[state].shape), -np.inf).argmax(axis=1)
    drawn = np.where(allowed, rng.random(allowed.shape), -1.0).argmax(axis=1)
    action = np.where(rng.random(args.num_envs) < args.epsilon, drawn, greedy)
    after, reward, terminated, truncated, info = envs.step(action)
    for n in np.flatnonzero(~begun):
        target = reward[n] + (0.0 if terminated[n] else args.gamma * q[after[n]].max())
        q[state[n], action[n]] += args.learning_rate * (target - q[state[n], action[n]])
    length = np.where(begun, 0, length + 1)
    begun = terminated | truncated
    lengths += length[begun].tolist()
    reached += terminated[begun].tolist()
    state = after
    if (step + 1) % 75 == 0:
        print(f"{(step + 1) * args.num_envs:5d} steps: {np.mean(reached[-40:]):.2f} of the last 40 episodes end at the goal", end="")
        print(f", after {np.mean(lengths[-40:]):.1f} actions")
