"""The compiled law, imported when it is first needed: `import mobee` compiles and loads no machine code."""

from __future__ import annotations

from functools import cache
from types import ModuleType


@cache
def law() -> ModuleType:
    """The module `mobee.control.law`, after the whole engine: a process compiles all of it at once, with progress, or nothing."""
    from mobee.engine.load import load

    load()
    from mobee.control import law as compiled

    return compiled


@cache
def reach_law() -> ModuleType:
    """The module `mobee.control.reach_law`, in the same way."""
    from mobee.engine.load import load

    load()
    from mobee.control import reach_law as compiled

    return compiled
