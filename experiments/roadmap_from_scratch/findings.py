"""What all maps amount to, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import told
from experiments.roadmap_from_scratch.settings import DEEP, SAMPLES

CLAIMS = (
    Claim("thesis 4.3.1, fig. 4.6", "explored at 10 % speed until the feasible sub-graph is known", "about 90 minutes"),
    Claim("thesis 4.3.1", "small, randomly generated graphs often contain unreachable vertices", "often"),
    Claim("thesis 4.3.1", "rollback works robustly, so that what was found of an edge stands: tried again from rest it does the same", "-"),
    Claim("aim of this reproduction", "no listed solid contact of PyBullet deeper than 2 mm while the map is explored live", "0"),
)
AGREE = 0.95


def unreached(values: Mapping[str, Any]) -> int:
    """How many of the samples were never come to."""
    goals, feasible = values["goals"], values["feasible"]
    come = np.zeros(len(goals), dtype=bool)
    come[goals[feasible]] = True
    come[np.flatnonzero((values["tried"] > 0).any(axis=1))] = True
    return int((~come[:SAMPLES]).sum())


def findings(found: Mapping[str, CellResult], live: Mapping[str, Any] | None) -> dict[str, Any]:
    """A row a map, and the claims."""
    results = sorted(found.values(), key=lambda result: result.cell.seed)
    rows = {f"seed {result.cell.seed}": _row(result.values) for result in results}
    if live is not None:
        rows["live"] = _row({**live, "minutes": [60.0 * live["hours"]]})
    return {"maps": rows, "claims": [claim.record() for claim in _claims([result.values for result in results], live)]}


def _row(values: Mapping[str, Any]) -> dict[str, Any]:
    tried = int((values["tried"] > 0).sum())
    return {
        "finished": bool(values["finished"]),
        "minutes": round(float(values["minutes"][-1]), 1) if len(values["minutes"]) else 0.0,
        "edges": int((values["goals"] >= 0).sum()),
        "tried": tried,
        "feasible": int(values["feasible"].sum()),
        "samples_not_come_to": unreached(values),
        "repairs": int(values["repairs"]),
        "agree": round(float(np.mean(values["agree"])), 3) if len(values["agree"]) else None,
        "deepest_mm": round(1e3 * float(values["deepest"]), 2),
    }


def _claims(maps: list[dict[str, Any]], live: Mapping[str, Any] | None) -> list[Claim]:
    done = [values for values in maps if values["finished"]]
    if not done:
        return list(CLAIMS)
    minutes = [float(values["minutes"][-1]) for values in done]
    agree = [float(np.mean(values["agree"])) for values in done]
    with_gaps = sum(unreached(values) > 0 for values in done)
    deepest = max(1e3 * float(values["deepest"]) for values in maps)
    share = told([float(values["feasible"].sum() / (values["tried"] > 0).sum()) for values in done])
    explored = f"{told(minutes, 0)} minutes; {share} of the edges tried are feasible"
    lived, holds = "not run live", None
    if live is not None:
        lived = f"live {1e3 * live['deepest']:.1f} mm in {live['hours']:.1f} h and {live['touches']} touches"
        explored += f"; live {60.0 * live['hours']:.0f} minutes"
        holds = live["deepest"] <= DEEP if live["finished"] else None
    agrees = bool(np.mean(agree) >= AGREE)
    return [
        CLAIMS[0].measured(explored, len(done) == len(maps)),
        CLAIMS[1].measured(f"{with_gaps} of {len(done)} maps of seven joints", 2 * with_gaps > len(done)),
        CLAIMS[2].measured(f"{told(agree, 3)} of the edges", agrees),
        CLAIMS[3].measured(f"{lived}; offline, by the model, {deepest:.1f} mm", holds),
    ]
