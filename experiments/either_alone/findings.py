"""What came of the cells, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.reaching.cases import SCENES, WAYS
from experiments.kit.reaching.targets import GOOD
from experiments.kit.statistics import interval, told
from mobee.robot.robot import Array

TOLD = {
    "free": "from arbitrary poses to targets in free space",
    "around": "around the target, the hand on its far side",
    "against": "with the hand against the object",
    "between": "past an obstacle between hand and target",
    "moving": "to a target that moves meanwhile",
}
LAWS = ("published", "default")
MEASURE = {"published": "reward", "default": "success"}
"""What decides: under the published law, whose reaches are for the centre, what the thesis measured (eq. 8.4)."""
MORE = {"reward": "bring more reward", "success": "more often bring the palm within 2 cm"}
CLAIMS = tuple(
    Claim(
        "thesis 5.3, 8.2, 9.3",
        f"coarse planner and reactive reach together {MORE[MEASURE[law]]} than either alone: {what} ({law} law)",
        "no number",
    )
    for law in LAWS
    for what in TOLD.values()
)


def measured(done: Mapping[str, CellResult], law: str, scene: str, way: str, measure: str) -> Array:
    """The mean over the cases, (seeds,); "success": the palm within 2 cm of the surface."""
    name = "missing" if measure == "success" else measure
    each = [one.values[f"{scene}|{way}|{name}"] for one in _of(done, law)]
    return np.array([(values <= GOOD if measure == "success" else values).mean() for values in each])


def better(both: Array, alone: Mapping[str, Array]) -> bool | None:
    """Whether both together do more (seeds,) than each alone; False if less than one."""
    spans = [interval(both - other) for other in alone.values()]
    if all(low > 0.0 for low, _ in spans):
        return True
    return False if any(high < 0.0 for _, high in spans) else None


def claims(done: Mapping[str, CellResult]) -> list[Claim]:
    """The claims with our numbers."""
    found = []
    for (law, scene), claim in zip(product(LAWS, SCENES), CLAIMS, strict=True):
        if not _of(done, law):
            found.append(claim.measured("not measured", None))
            continue
        each = {way: measured(done, law, scene, way, MEASURE[law]) for way in WAYS}
        numbers = ", ".join(f"{'both' if way == 'both' else way + ' alone'} {told(values)}" for way, values in each.items())
        found.append(claim.measured(f"{MEASURE[law]} {numbers}", better(each["both"], {way: each[way] for way in WAYS[:2]})))
    return found


def summary(done: Mapping[str, CellResult]) -> dict[str, Any]:
    """The table of the results, as text."""
    rows = []
    for law, scene, way in product(LAWS, SCENES, WAYS):
        if _of(done, law):
            row = {measure: told(measured(done, law, scene, way, measure)) for measure in ("success", "reward")}
            missing = told([100.0 * float(np.median(one.values[f"{scene}|{way}|missing"])) for one in _of(done, law)], 1)
            seconds = told(measured(done, law, scene, way, "seconds"), 1)
            rows.append({"law": law, "scene": scene, "who": way, **row, "median missing [cm]": missing, "seconds": seconds})
    return {"cases": rows}


def _of(done: Mapping[str, CellResult], law: str) -> list[CellResult]:
    return sorted((one for one in done.values() if one.cell.settings["law"] == law), key=lambda one: one.cell.seed)
