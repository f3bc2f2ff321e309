from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.control.ride import place
from experiments.pregrasp.figure import draw
from experiments.pregrasp.findings import CLAIMS, findings
from experiments.pregrasp.settings import SPACINGS, built
from experiments.pregrasp.trial import MODES, Passing, queried
from experiments.trm.body import RIGHT_ARM
from mobee import MotorParameters, OfflinePlant


def test_in_the_poses_of_the_map_the_arm_rests_where_it_is_sent() -> None:
    roadmap = built(SPACINGS[0])
    assert len(roadmap.q) > 50
    plant = OfflinePlant(roadmap.model, motors=MotorParameters.identified("icub"), dt=0.02, active=RIGHT_ARM)
    arm = plant.robot.parts["right_arm"].slice
    for q in roadmap.q[::25]:
        assert np.abs(plant.act("right_arm", q[arm]).q - q[arm]).max() < 0.03


def test_a_vertex_is_passed_before_the_arm_rests() -> None:
    roadmap = built(SPACINGS[0])
    plant = OfflinePlant(roadmap.model, motors=MotorParameters.identified("icub"), dt=0.02, active=RIGHT_ARM)
    arm = plant.robot.parts["right_arm"].slice
    first, far = roadmap.q[0], roadmap.q[np.abs(roadmap.q - roadmap.q[0]).max(axis=1).argmax()]
    place(plant, first)
    outcome = Passing(plant, 0.1).act("right_arm", far[arm])
    assert not outcome.settled and 0.02 < np.abs(outcome.q - far[arm]).max() <= 0.1


def test_a_query_past_a_cup_is_answered_in_both_modes() -> None:
    values = queried(0, SPACINGS[0], 1)
    for mode in MODES:
        assert values[f"{mode}|success"].all() and values[f"{mode}|walked"][0] >= 3


def values(vertices: int, bumps: int, success: bool = True) -> dict:
    found = {"vertices": vertices, "edges": 8 * vertices}
    for mode in MODES:
        found |= {f"{mode}|success": np.array([success, True]), f"{mode}|bumps": np.array([bumps, bumps])}
        found |= {f"{mode}|{name}": np.array([9.0, 9.0]) for name in ("walked", "seconds")}
    return found


def results(few: int, many: int, success: bool = True) -> dict:
    cells = [(spacing, vertices, bumps, seed) for spacing, vertices, bumps in ((0.02, 75, few), (0.002, 5000, many)) for seed in range(3)]
    return {
        f"{spacing}-{seed}": SimpleNamespace(
            cell=SimpleNamespace(seed=seed, settings={"spacing": spacing}), values=values(vertices, bumps + seed, success)
        )
        for spacing, vertices, bumps, seed in cells
    }


@pytest.mark.parametrize(
    ("found", "verdicts"),
    [
        (results(1, 90), ["confirmed", "confirmed"]),
        (results(9, 9), ["confirmed", "refuted"]),
        (results(1, 90, False), ["refuted", "confirmed"]),
    ],
)
def test_bumps_that_grow_and_queries_that_fail_decide(found: dict, verdicts: list[str], tmp_path) -> None:
    told = findings(found)
    assert [claim["verdict"] for claim in told["claims"]] == verdicts and len(verdicts) == len(CLAIMS)
    assert told["maps"]["75 vertices, remove"]["seeds"] == 3
    assert draw(found, tmp_path / "pregrasp.png").exists()
