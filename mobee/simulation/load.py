"""The compiled motors and the compiled loop, imported when they are first needed: `import mobee` loads no machine code."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import ModuleType


@dataclass(frozen=True, slots=True)
class Compiled:
    """The modules."""

    braking: ModuleType
    drive: ModuleType
    loop: ModuleType
    noise: ModuleType


@cache
def compiled() -> Compiled:
    """The modules, after the whole engine: a process compiles all of it at once, with progress, or nothing."""
    from mobee.engine.load import load

    load()
    from mobee.simulation import braking, drive, loop, noise

    return Compiled(braking, drive, loop, noise)
