"""Formats a roadmap, 80 columns wide."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Robot

COLUMNS = 80


def wrapped(text: str, indent: str = "") -> list[str]:
    """Lines of at most COLUMNS."""
    return textwrap.wrap(text, COLUMNS, initial_indent=indent, subsequent_indent=f"{indent}  ", break_on_hyphens=False)


def summary(trm: Roadmap, path: Path) -> list[str]:
    """Its size, its task, where it came from."""
    told = trm.settings
    parts = np.bincount(trm.graph.components) if len(trm.q) else np.empty(0, dtype=int)
    unfinished = "" if told.get("finished", True) else ", not finished: build it again to go on"
    lines = wrapped(f"{path}: {len(trm.q)} poses, {len(trm.edges)} edges{unfinished}.")
    if len(parts) > 1:
        sizes = ", ".join(map(str, parts[:5])) + (", ..." if len(parts) > 5 else "")
        lines += wrapped(f"In {len(parts)} parts that no edge connects, of {sizes} poses.")
    objects = ", ".join(trm.model.world.objects) or "nothing"
    robot, world = told.get("robot_digest", "?"), told.get("world_digest", "?")
    lines += wrapped(f"Robot {trm.model.robot.name} {robot}, world {world} ({objects}).")
    lines += wrapped(f"Moves {', '.join(_as_parts(trm.model.robot, trm.motors))}.")
    if told.get("costs"):
        lines += wrapped(f"Costs: {', '.join(told['costs'])}.")
    made = [f"{key} {told[key]}" for key in ("method", "seed", "neighbours", "longest") if told.get(key) is not None]
    if told.get("evaluations") is not None:
        made.append(f"{told['evaluations']} evaluations")
    if told.get("seconds") is not None:
        made.append(f"{told['seconds']:.1f} s")
    if made:
        lines += wrapped(f"Made by {', '.join(made)}.")
    lines.append(f"{'coordinate':<32}{'spacing':>9}{'poses from':>12}{'to':>9}{'box from':>10}{'to':>8}")
    units, box = told.get("units") or [""] * len(trm.names), told.get("box") or [(np.nan, np.nan)] * len(trm.names)
    for k, name in enumerate(trm.names):
        low, high = (f"{value:.3f}" for value in (trm.y[:, k].min(), trm.y[:, k].max())) if len(trm.y) else ("-", "-")
        label = f"{name} [{units[k]}]" if units[k] else name
        lines.append(f"{label[:32]:<32}{trm.spacing[k]:>9.4g}{low:>12}{high:>9}{_number(box[k][0]):>10}{_number(box[k][1]):>8}")
    return lines


def edges_told(trm: Roadmap) -> list[str]:
    """How far the motors turn along its edges."""
    if not len(trm.edges):
        return []
    turns = np.abs(trm.q[trm.edges[:, 0]] - trm.q[trm.edges[:, 1]]).max(axis=1)
    usual, rare = np.quantile(turns, (0.5, 0.95))
    return wrapped(f"Along an edge a motor turns by {usual:.2f} rad (median), {rare:.2f} (95 %), {turns.max():.2f} (most).")


def as_json(trm: Roadmap, path: Path) -> dict[str, Any]:
    """The same as plain JSON values."""
    return {
        "map": str(path),
        "poses": len(trm.q),
        "edges": len(trm.edges),
        "parts": np.bincount(trm.graph.components).tolist() if len(trm.q) else [],
        "names": list(trm.names),
        "spacing": trm.spacing.tolist(),
        "low": trm.y.min(axis=0).tolist() if len(trm.y) else None,
        "high": trm.y.max(axis=0).tolist() if len(trm.y) else None,
        "settings": trm.settings,
    }


def _as_parts(robot: Robot, motors: tuple[str, ...]) -> list[str]:
    """Whole parts by their names, the rest motor by motor."""
    found, left = [], list(motors)
    for name, part in robot.parts.items():
        if set(part.motors) <= set(left):
            found.append(name)
            left = [motor for motor in left if motor not in part.motors]
    return [*found, *left]


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3g}"
