"""The compiled motors and the compiled loop, imported when they are first needed: `import mobee` loads no machine code.

A process that only drives motors, as robot_sim does, needs neither the loop nor the model's engine and starts in less time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import ModuleType


@dataclass(frozen=True, slots=True)
class Compiled:
    """The modules of motors."""

    braking: ModuleType
    drive: ModuleType
    noise: ModuleType


@cache
def compiled() -> Compiled:
    """The modules of motors: where they are not compiled yet, all of the engine is, with progress."""
    from mobee.engine.load import load_only

    return Compiled(*(load_only(f"mobee.simulation.{name}") for name in ("braking", "drive", "noise")))


@cache
def compiled_loop() -> ModuleType:
    """The module of the loop, in the same way."""
    from mobee.engine.load import load_only

    return load_only("mobee.simulation.loop")
