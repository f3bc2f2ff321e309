"""All maps on one sheet."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from experiments.drawing.sheet import write_sheet
from experiments.kit.cells import CellResult
from experiments.trm.building import rebuilt
from experiments.trm.examples import EXAMPLES
from experiments.trm.findings import NAMES, REACH
from experiments.trm.pictures import cloud_panel
from mobee.errors import InvalidValue

COLUMNS, HEIGHT = 4, 240


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """The cloud of every task's first map, by evolution where there is one."""
    built = [one for one in found.values() if one.cell.settings["method"] != REACH]
    built.sort(key=lambda one: (list(NAMES).index(one.cell.settings["method"]), one.cell.seed), reverse=True)
    chosen = {one.cell.settings["task"]: one for one in built}
    tasks = [task for task in EXAMPLES if task in chosen]
    if not tasks:
        raise InvalidValue(f"{path.parent} has no finished maps: it was stopped before the first.")
    panels = []
    for task in tasks:
        example = EXAMPLES[task]()
        panels.append(cloud_panel(example, rebuilt(example, chosen[task].values), HEIGHT))
    rows = [("", panels[first : first + COLUMNS]) for first in range(0, len(panels), COLUMNS)]
    return write_sheet(rows, path)
