"""Loads the engine's machine code, and says so where a person would wait for it to be compiled."""

from __future__ import annotations

import importlib
import sys
import time

MODULES = ("mobee.engine.scene", "mobee.engine.evaluate")


def load() -> None:
    """Import what is compiled; the first time after an install or an edit with a line on stderr before and after."""
    if MODULES[-1] in sys.modules:
        return
    from mobee.engine.compiled import cache_folder, is_ready, mark_ready

    ready = is_ready()
    start = time.perf_counter()
    if not ready:
        print(
            f"mobee: compiling the engine into {cache_folder()}, once after an install (about half a minute) ...",
            file=sys.stderr,
            flush=True,
        )
    for module in MODULES:
        importlib.import_module(module)
    if not ready:
        mark_ready()
        _say(f"the engine is compiled, {time.perf_counter() - start:.0f} s.")


def _say(what: str) -> None:
    print(f"mobee: {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    load()
