# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.claims.ch8_reaching.roadmap_density import (
    CLAIMS,
    MIN_DISTANCE,
    MODES,
    SPACINGS,
    Query,
    built,
    draw_query,
    findings,
    plot,
    walked,
)
from experiments.kit.roadmap_task import RIGHT
from mobee import Model, Roadmap, World, load_robot
from mobee.roadmap.edges import check_edges
from tests.experiments.finished_cells import Cell, finished


@pytest.fixture(scope="module")
def query() -> Query:
    return draw_query(np.random.default_rng(0), built(SPACINGS[0]))


def test_the_shortest_path_of_a_query_is_blocked_and_another_path_remains(query: Query) -> None:
    roadmap = built(SPACINGS[0])
    palms = roadmap.model.evaluate(roadmap.q[[query.start, query.goal]]).position(RIGHT)
    assert np.linalg.norm(palms[0] - palms[1]) >= MIN_DISTANCE
    path = roadmap.graph.shortest(query.start, query.goal)
    pairs = np.sort(np.stack([path[:-1], path[1:]], axis=1), axis=1)
    assert not check_edges(query.model, roadmap.q, pairs).all()
    assert roadmap.graph.shortest(query.start, query.goal, query.blocked) is not None


@pytest.mark.parametrize("mode", MODES)
def test_a_walk_passes_only_free_edges_and_bumps_at_most_once_per_edge(query: Query, mode: str) -> None:
    roadmap = built(SPACINGS[0])
    walk = walked(roadmap, query, mode)
    assert walk.arrived and walk.path[0] == query.start and walk.path[-1] == query.goal
    pairs = np.sort(np.stack([walk.path[:-1], walk.path[1:]], axis=1), axis=1)
    assert check_edges(query.model, roadmap.q, pairs).all()
    assert 1 <= walk.bumps <= len(query.blocked) and walk.edges == walk.bumps + len(pairs)


def test_a_walk_ends_where_no_path_remains() -> None:
    icub = load_robot("icub")
    model = Model(icub, World())
    line = np.repeat(icub.home[None], 3, axis=0)
    line[:, 0] = [0.0, 0.1, 0.2]
    roadmap = Roadmap(model, line, np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0]]), np.array([[0, 1], [1, 2]]), np.array([0.1, 0.1]), {})
    for mode in MODES:
        walk = walked(roadmap, Query(0, 2, model, frozenset({(1, 2)})), mode)
        assert not walk.arrived and walk.bumps == 1 and walk.path == (0, 1)


def results(few: int, many: int, around: int, arrived: bool = True) -> dict[str, Any]:
    def work(cell: Cell) -> dict[str, Any]:
        vertices, bumps = {0.04: (180, few), 0.008: (4400, many)}[cell.settings["spacing"]]
        values: dict[str, Any] = {"vertices": vertices, "edges": 8 * vertices, "invalid": np.array([9, 9]), "off": 0.01, "solid": 0.0}
        for mode, number in (("edge", bumps), ("around", around)):
            values[f"{mode}|arrived"] = np.array([arrived, arrived])
            values[f"{mode}|bumps"] = np.array([number, number + cell.seed])
            values |= {f"{mode}|{name}": np.array([9.0, 9.0]) for name in ("edges", "seconds")}
        return values

    return finished(work, [Cell(f"d{spacing}-s{seed}", seed, {"spacing": spacing}) for spacing in (0.04, 0.008) for seed in range(3)])


@pytest.mark.parametrize(
    ("found", "verdicts"),
    [
        (results(9, 90, 5), ["confirmed", "confirmed", "met"]),
        (results(90, 9, 9), ["confirmed", "not reproduced", "not met"]),
        (results(9, 90, 99, arrived=False), ["not reproduced", "confirmed", "not met"]),
    ],
)
def test_bumps_and_failed_queries_decide_the_claims(found: dict[str, Any], verdicts: list[str], tmp_path: Path) -> None:
    results = findings(found)
    assert [claim["verdict"] for claim in results["claims"]] == verdicts and len(verdicts) == len(CLAIMS)
    assert results["executed"]["paths without a solid contact"] == results["executed"]["paths"] == 6
    plot(found).savefig(tmp_path / "pregrasp.png")
