"""The compiled law, imported when it is first needed: `import mobee` compiles and loads no machine code."""

from __future__ import annotations

from functools import cache
from types import ModuleType


@cache
def law() -> ModuleType:
    """The module `mobee.control.law`; where it is not compiled yet, all of the engine is, with progress."""
    from mobee.engine.load import load_only

    return load_only("mobee.control.law")


@cache
def reach_law() -> ModuleType:
    """The module `mobee.control.reach_law`, in the same way."""
    from mobee.engine.load import load_only

    return load_only("mobee.control.reach_law")
