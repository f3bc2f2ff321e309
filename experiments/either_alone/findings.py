"""What came of the cells, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.claims import Claim
from experiments.either_alone.cases import SCENES
from experiments.either_alone.trial import WAYS
from experiments.reaching.arm import GOOD
from experiments.statistics import interval, told
from experiments.sweep import CellResult
from mobee.robot.robot import Array

TOLD = {
    "free": "from arbitrary poses to targets in free space",
    "around": "around the target, the hand on its far side",
    "against": "with the hand against the object",
    "between": "past an obstacle between hand and target",
    "moving": "to a target that moves meanwhile",
}
CLAIMS = tuple(
    Claim("thesis 5.3, 8.2, 9.3", f"coarse planner and reactive reach together do more than either alone: {what}", "no number")
    for what in TOLD.values()
)


def success(done: Mapping[str, CellResult], scene: str, way: str) -> Array:
    """The share of cases with the palm within 2 cm of the surface, (seeds,)."""
    return np.array([(one.values[f"{scene}|{way}|missing"] <= GOOD).mean() for one in _ordered(done)])


def better(both: Array, alone: Mapping[str, Array]) -> bool | None:
    """Whether both together have more success (seeds,) than each alone; False if less than one."""
    spans = [interval(both - other) for other in alone.values()]
    if all(low > 0.0 for low, _ in spans):
        return True
    return False if any(high < 0.0 for _, high in spans) else None


def claims(done: Mapping[str, CellResult]) -> list[Claim]:
    """The claims with our numbers."""
    found = []
    for scene, claim in zip(SCENES, CLAIMS, strict=True):
        each = {way: success(done, scene, way) for way in WAYS}
        text = "success " + ", ".join(f"{'both' if way == 'both' else way + ' alone'} {told(values)}" for way, values in each.items())
        found.append(claim.measured(text, better(each["both"], {way: each[way] for way in WAYS[:2]})))
    return found


def summary(done: Mapping[str, CellResult]) -> dict[str, Any]:
    """The table of the results, as text."""
    rows = []
    for scene in SCENES:
        for way in WAYS:
            measured = {name: [one.values[f"{scene}|{way}|{name}"] for one in _ordered(done)] for name in ("missing", "seconds")}
            rows.append(
                {
                    "scene": scene,
                    "who": way,
                    "success": told(success(done, scene, way)),
                    "median missing [cm]": told([100.0 * float(np.median(values)) for values in measured["missing"]], 1),
                    "seconds": told([float(values.mean()) for values in measured["seconds"]], 1),
                }
            )
    return {"cases": rows}


def _ordered(done: Mapping[str, CellResult]) -> list[CellResult]:
    return sorted(done.values(), key=lambda one: one.cell.seed)
