"""Many independent runs of one piece of work, on all cores or machines; what is finished is never done again."""

from __future__ import annotations

from experiments.sweep.arguments import sweep_arguments
from experiments.sweep.cell import Cell, CellResult
from experiments.sweep.cell_files import load_cells
from experiments.sweep.run_cells import CellsFailed, run_cells

__all__ = ["Cell", "CellResult", "CellsFailed", "load_cells", "run_cells", "sweep_arguments"]
