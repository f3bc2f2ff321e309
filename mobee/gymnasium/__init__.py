# SPDX-License-Identifier: Apache-2.0
"""MoBeE and Gymnasium: the robot as an environment, and any discrete environment as a plant for the curious agent.

`import mobee.gymnasium` registers the ids `MoBeE/Lattice-v0`, `MoBeE/Reach-v0`, `MoBeE/RiverSwim-v0` and `MoBeE/DeepSea-v0`.
`gymnasium.make("mobee.gymnasium:MoBeE/Reach-v0")` imports this module by itself. `TableEnv()` is `MoBeE/Table-v0`: torso and arms of
the iCub at a table, each part an agent of its own; it follows the interface of PettingZoo, which has no registry.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

from mobee.errors import NotInstalled

if importlib.util.find_spec("gymnasium") is None:
    raise NotInstalled('mobee.gymnasium needs Gymnasium, which is not installed: pip install "mobee[gym]"')

from mobee.gymnasium.registration import register_envs as _register_envs

if TYPE_CHECKING:
    from mobee.gymnasium.discrete import EnvPlant, TabularEnv
    from mobee.gymnasium.lattice import LatticeEnv, LatticeTask, LatticeVectorEnv
    from mobee.gymnasium.reach import ReachEnv, ReachTask, ReachVectorEnv
    from mobee.gymnasium.table import TableEnv, TableTask

_MODULES = {
    "mobee.gymnasium.discrete": "EnvPlant TabularEnv",
    "mobee.gymnasium.lattice": "LatticeEnv LatticeTask LatticeVectorEnv",
    "mobee.gymnasium.reach": "ReachEnv ReachTask ReachVectorEnv",
    "mobee.gymnasium.table": "TableEnv TableTask",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = [
    "EnvPlant",
    "LatticeEnv",
    "LatticeTask",
    "LatticeVectorEnv",
    "ReachEnv",
    "ReachTask",
    "ReachVectorEnv",
    "TableEnv",
    "TableTask",
    "TabularEnv",
]

_register_envs()


def __getattr__(name: str) -> Any:
    """Import the module of a public name when the name is first used."""
    if name not in _HOME:
        raise AttributeError(f"module 'mobee.gymnasium' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
