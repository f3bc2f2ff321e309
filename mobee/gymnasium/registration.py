# SPDX-License-Identifier: Apache-2.0
"""The ids of the environments in Gymnasium's registry."""

from __future__ import annotations

from gymnasium.envs.registration import register, registry

LATTICE, REACH, RIVER_SWIM, DEEP_SEA = "MoBeE/Lattice-v0", "MoBeE/Reach-v0", "MoBeE/RiverSwim-v0", "MoBeE/DeepSea-v0"
LATTICE_STEPS, REACH_STEPS, RIVER_SWIM_STEPS = 200, 50, 200  # after which an episode is truncated


def register_envs() -> None:
    """Register the environments of this package in Gymnasium's registry, except those that are registered already."""
    here = "mobee.gymnasium"
    robots = (("Lattice", LATTICE, LATTICE_STEPS), ("Reach", REACH, REACH_STEPS))
    for name, env_id, steps in robots:
        if env_id not in registry:
            module = f"{here}.{name.lower()}"
            register(env_id, f"{module}:{name}Env", max_episode_steps=steps, vector_entry_point=f"{module}:{name}VectorEnv")
    if RIVER_SWIM not in registry:
        register(RIVER_SWIM, f"{here}.discrete:river_swim_env", max_episode_steps=RIVER_SWIM_STEPS)
    if DEEP_SEA not in registry:
        register(DEEP_SEA, f"{here}.discrete:deep_sea_env")
