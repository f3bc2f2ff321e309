# SPDX-License-Identifier: Apache-2.0
"""A sweep to be started, interrupted and killed: python -m tests.experiments.kit.toy_sweep FOLDER [--seeds N ...]."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from experiments.kit.cells import Cell
from experiments.kit.sweep import run_cells, sweep_arguments


def options(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--holds")
    sweep_arguments(parser, seeds=4)
    return parser.parse_args(given or None)


def cells(count: int, **settings: object) -> list[Cell]:
    return [Cell(f"toy-s{seed}", seed, dict(settings)) for seed in range(count)]


def work(cell: Cell) -> dict[str, object]:
    """Leaves a line in a log each time it is done, so that repetitions show."""
    if cell.settings.get("fails") == cell.seed:
        raise ValueError("the toy is broken")
    if cell.settings.get("dies") == cell.seed:
        os.kill(os.getpid(), signal.SIGKILL)
    if holds := cell.settings.get("holds"):
        held = Path(f"{holds}-{cell.seed}")
        try:
            held.touch()
            time.sleep(60.0)
        finally:
            time.sleep(0.5)  # as a live system that ends
            held.unlink(missing_ok=True)
    time.sleep(cell.settings.get("seconds", 0.0))
    if log := cell.settings.get("log"):
        with open(log, "a") as file:
            file.write(f"{cell.name} {os.getpid()}\n")
    return {"square": cell.seed**2, "row": np.arange(cell.seed), "nested": {"pi": np.float64(3.5)}}


def signals_of_a_child(cell: Cell) -> dict[str, object]:
    """Returns what a process that the cell starts does on Ctrl-C."""
    code = "import signal; print(signal.getsignal(2) is signal.default_int_handler, len(signal.pthread_sigmask(signal.SIG_BLOCK, ())))"
    return {"said": subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()}


def forgetful(cell: Cell) -> None:
    pass


def useless(cell: Cell) -> dict[str, object]:
    return {"is": object()}


if __name__ == "__main__":
    arguments = options()
    settings = {"seconds": arguments.seconds, "log": str(arguments.folder / "log")}
    settings |= {"holds": arguments.holds} if arguments.holds else {}
    run_cells(work, cells(arguments.seeds, **settings), arguments.folder, arguments)
