"""Bumps against density, in numbers, and what they say of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.claims import Claim
from experiments.pregrasp.trial import MODES
from experiments.statistics import interval, told
from experiments.sweep import CellResult

CLAIMS = (
    Claim("thesis 4.3.3", "re-planning on bumps works well in practice: the hand comes past a cup that no map has", "works well"),
    Claim("thesis 4.4", "an obstacle invalidates many edges of a dense map: bumps until success grow with its density", "a very long time"),
)
WELL = 0.9
Groups = dict[float, list[dict[str, Any]]]


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The values of the runs with each spacing, the widest first."""
    grouped: Groups = {}
    for result in sorted(found.values(), key=lambda result: (-result.cell.settings["spacing"], result.cell.seed)):
        grouped.setdefault(result.cell.settings["spacing"], []).append(result.values)
    return grouped


def of_seed(values: Mapping[str, Any], mode: str, name: str) -> float:
    """The mean over the queries of a run; of bumps and seconds over those that succeeded, NaN if none did."""
    good = values[f"{mode}|success"]
    kept = values[f"{mode}|{name}"] if name == "success" else values[f"{mode}|{name}"][good]
    return float(np.mean(kept)) if len(kept) else float("nan")


def numbers(runs: list[dict[str, Any]], mode: str, name: str) -> np.ndarray:
    """Of all runs that have one, (n,)."""
    found = np.array([of_seed(values, mode, name) for values in runs])
    return found[np.isfinite(found)]


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a density and mode, and the claims."""
    grouped = groups(found)
    rows = {
        f"{runs[0]['vertices']} vertices, {mode}": {"spacing_mm": 1e3 * spacing, "seeds": len(runs)}
        | {name: told(values) for name in ("success", "bumps", "walked", "seconds") if len(values := numbers(runs, mode, name))}
        for spacing, runs in grouped.items()
        for mode in MODES
    }
    return {"maps": rows, "claims": [claim.record() for claim in _claims(grouped)]}


def _claims(grouped: Groups) -> list[Claim]:
    if len(grouped) < 2:
        return list(CLAIMS)
    first, *_, last = grouped.values()
    seeds = range(min(map(len, grouped.values())))
    everything = [float(np.mean([of_seed(runs[seed], "remove", "success") for runs in grouped.values()])) for seed in seeds]
    few, many = numbers(first, "remove", "bumps"), numbers(last, "remove", "bumps")
    success = ", ".join(f"{runs[0]['vertices']}: {np.mean(numbers(runs, 'remove', 'success')):.2f}" for runs in grouped.values())
    bumps = ", ".join(f"{runs[0]['vertices']}: {told(b, 1)}" for runs in grouped.values() if len(b := numbers(runs, "remove", "bumps")))
    grows = bool(interval(many)[0] > interval(few)[1]) if len(few) and len(many) else None
    return [
        CLAIMS[0].measured(f"{told(everything)} of all queries; by vertices {success}", float(np.mean(everything)) >= WELL),
        CLAIMS[1].measured(f"bumps a query by vertices {bumps}", grows),
    ]
