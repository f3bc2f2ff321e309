"""What edge checks are measured on: the thesis' pre-grasp map, a palm above the table every few millimetres, k = 8 (fig. 4.8)."""

from __future__ import annotations

from dataclasses import replace

from experiments.claims.ch3_roadmaps.trm_tasks import pregrasp
from experiments.kit.roadmap_task import RIGHT, build
from mobee import Roadmap

MARKER = RIGHT
NEIGHBOURS = 8


def palm_map(spacing: float) -> Roadmap:
    """The map with that spacing [m], up to the motors' limits, each pose joined to the nearest 8."""
    return build(replace(pregrasp(), spacing=spacing, margin=0.0), "least_squares", neighbours=NEIGHBOURS)
