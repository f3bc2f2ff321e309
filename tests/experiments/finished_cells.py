# SPDX-License-Identifier: Apache-2.0
"""Finished cells without a disk."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from experiments.kit.cells import Cell, CellResult
from experiments.kit.sweep import Trial


def finished(work: Callable[[Cell], dict[str, Any]], cells: Iterable[Cell]) -> dict[str, CellResult]:
    found = {}
    for cell in cells:
        found[cell.name] = CellResult(cell, 1.0, Path())
        vars(found[cell.name])["values"] = work(cell)  # the cache of the property
    return found


def finished_trials(trial: Trial, cells: Iterable[Cell]) -> dict[str, CellResult]:
    return finished(lambda cell: trial(cell.settings, cell.seed), cells)
