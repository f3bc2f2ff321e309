"""Bumps against density, in numbers, and what they say of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import interval, told
from experiments.pregrasp.trial import MODES
from mobee.robot.robot import Array

CLAIMS = (
    Claim("thesis 4.3.3", "re-planning on bumps works well in practice: the hand comes past a cup that no map has", "works well"),
    Claim("thesis 4.4", "an obstacle invalidates many edges of a dense map: bumps until success grow with its density", "a very long time"),
    Claim(
        "aim of this reproduction", "taking out what lies around a bump, not the edge alone, needs fewer bumps in the densest map", "fewer"
    ),
)
WELL = 0.9
Groups = dict[float, list[dict[str, Any]]]


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The values of the runs with each spacing, the widest first."""
    grouped: Groups = {}
    for result in sorted(found.values(), key=lambda result: (-result.cell.settings["spacing"], result.cell.seed)):
        grouped.setdefault(result.cell.settings["spacing"], []).append(result.values)
    return grouped


def numbers(runs: list[dict[str, Any]], mode: str, name: str) -> Array:
    """The mean over the queries of each run, (n,)."""
    return np.array([float(np.mean(values[f"{mode}|{name}"])) for values in runs])


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a density and mode, and the claims."""
    grouped = groups(found)
    rows = [
        {"vertices": runs[0]["vertices"], "spacing_mm": 1e3 * spacing, "taken out": mode, "seeds": len(runs)}
        | {"invalid edges": told([float(np.mean(values["invalid"])) for values in runs], 0)}
        | {name: told(numbers(runs, mode, name)) for name in ("arrived", "bumps", "edges", "seconds")}
        for spacing, runs in grouped.items()
        for mode in MODES
    ]
    return {"maps": rows, "played": _played(grouped), "claims": [claim.record() for claim in _claims(grouped)]}


def _played(grouped: Groups) -> dict[str, Any]:
    """Of the ways that were found and followed under the control law: how many, the deepest solid contact, how far off the palm ends."""
    every = [values for runs in grouped.values() for values in runs if np.isfinite(values["solid"])]
    if not every:
        return {"ways": 0}
    solid, off = (np.array([values[name] for values in every]) for name in ("solid", "off"))
    return {
        "ways": len(every),
        "without a solid contact": int((solid == 0.0).sum()),
        "deepest_mm": 1e3 * float(solid.max()),
        "palm_off_cm": told(100.0 * off, 1),
    }


def _claims(grouped: Groups) -> list[Claim]:
    if len(grouped) < 2:
        return list(CLAIMS)
    first, *_, last = grouped.values()
    seeds = range(min(map(len, grouped.values())))
    everything = [float(np.mean([numbers(runs, "edge", "arrived")[seed] for runs in grouped.values()])) for seed in seeds]
    bumps = ", ".join(f"{runs[0]['vertices']}: {told(numbers(runs, 'edge', 'bumps'), 1)}" for runs in grouped.values())
    few, many, around = (numbers(runs, mode, "bumps") for runs, mode in ((first, "edge"), (last, "edge"), (last, "around")))
    saved = many - around
    return [
        CLAIMS[0].measured(f"{told(everything)} of all queries arrive", float(np.mean(everything)) >= WELL),
        CLAIMS[1].measured(f"bumps a query by vertices {bumps}", _above(interval(many), interval(few))),
        CLAIMS[2].measured(
            f"{told(around, 1)} instead of {told(many, 1)} bumps with {last[0]['vertices']} vertices", _above(interval(saved), (0.0, 0.0))
        ),
    ]


def _above(one: tuple[float, float], other: tuple[float, float]) -> bool | None:
    """Whether an interval lies above another one; None where they overlap."""
    if one[0] > other[1]:
        return True
    return False if one[1] < other[0] else None
