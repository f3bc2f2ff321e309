from __future__ import annotations

import argparse

import numpy as np
import pytest

from experiments import trm
from experiments.kit.cells import Cell
from experiments.trm.building import METHODS, build, built, rebuilt
from experiments.trm.examples import EXAMPLES
from experiments.trm.findings import CLAIMS, COLUMNS, GRAPH, MAPS, NAMES, PREGRASP, SIZE, SOON, VALID, findings, judged, maps
from experiments.trm.pictures import cloud_panel, planned, told
from mobee.roadmap.roadmap import Roadmap
from tests.experiments.finished_cells import finished


@pytest.fixture(scope="module")
def pushing() -> Roadmap:
    return build(EXAMPLES["push-over"](), "least_squares")


def table(**changes: float) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Numbers of two seeds of sound maps."""
    row = dict.fromkeys(COLUMNS, 1.0) | {"vertices": 5000.0} | changes
    return {(task, method): {name: np.full(2, value) for name, value in row.items()} for task in EXAMPLES for method in NAMES}


def verdicts(runs: dict[tuple[str, str], dict[str, np.ndarray]]) -> dict[str, str]:
    return {claim.text: claim.verdict for claim in judged(runs)}


def test_a_film_goes_through_the_points_of_its_way(pushing: Roadmap) -> None:
    example = EXAMPLES["push-over"]()
    motion = planned(example, pushing)
    y = example.task.of(example.model.evaluate(np.array([pose.q for pose in motion.poses])))
    assert [np.abs(y - point).max(axis=1).min() <= example.spacing for point in example.way] == [True, True]
    assert np.abs(np.diff([pose.q for pose in motion.poses], axis=0)).max() <= 0.05 + 1e-12
    assert (np.diff(motion.times) > 0.0).all()


def test_task_coordinates_are_told_in_cm_and_degrees() -> None:
    both = EXAMPLES["both-held"]().task.coordinates + EXAMPLES["inspect"]().task.coordinates
    assert told(both, np.array([-0.301, 0.12, np.pi / 2])) == "x -30, z 12, 90° cm"


def test_a_cloud_has_the_places_of_all_markers(pushing: Roadmap) -> None:
    panel = cloud_panel(EXAMPLES["push-over"](), pushing, 40)
    assert panel.picture.shape[0] == 40 and "push over" in panel.caption


def test_what_was_built_says_how_sound_it_is_and_can_be_had_again() -> None:
    example = EXAMPLES["inspect"]()
    values = built(example, "least_squares", 0)
    assert values["valid"] == 1.0 and 0.0 < values["connected"] <= 1.0 and values["vertices"] == len(values["q"])
    again = rebuilt(example, values)
    np.testing.assert_array_equal(again.y, example.task.of(example.model.evaluate(values["q"])))


def test_cells_are_what_can_be_reached_and_a_map_for_every_method_and_seed() -> None:
    cells = trm.cells(argparse.Namespace(seed=3, seeds=2, quick=False, tasks=["inspect", "unscrew"]))
    assert len({cell.name for cell in cells}) == len(cells) == 2 * (1 + 2 * len(METHODS))
    assert len(trm.cells(argparse.Namespace(seed=0, seeds=1, quick=True, tasks=None))) == len(trm.QUICK) * (1 + len(METHODS))


def test_claims_hold_of_sound_maps_and_fail_with_one_that_is_not() -> None:
    assert set(verdicts(table()).values()) == {"confirmed"}
    for name, value, claim in (
        ("coverage", 0.9, MAPS),
        ("valid", 0.999, VALID),
        ("connected", 0.9, GRAPH),
        ("vertices", 900.0, SIZE),
        ("processor_s", 130.0, SOON),
    ):
        wrong = table()
        wrong[PREGRASP if claim is SIZE else "inspect", "nes"][name][1] = value
        found = verdicts(wrong)
        assert [text for text, verdict in found.items() if verdict == "refuted"] == [claim.text]


def test_claims_stay_open_until_every_task_was_mapped_by_both_methods() -> None:
    runs = table()
    del runs["inspect", "nes"]
    assert judged(runs) == list(CLAIMS)


def test_coverage_is_that_of_what_all_maps_and_the_search_reached() -> None:
    values = {"vertices": 2, "processor_s": 1.0, "valid": 1.0, "kept": 1.0, "free": 1.0, "connected": 1.0, "evaluations": 30}
    arrays = {"y": np.array([[0.0], [0.1]]), "spacing": np.array([0.1])}
    told_by = {
        "reach": {"points": np.array([[0.05], [0.43]])},
        "first": values | arrays,
        "second": values | arrays | {"y": np.array([[0.25], [0.35]])},
    }
    cells = [Cell(name, k, {"task": "inspect", "method": "reach" if name == "reach" else "nes"}) for k, name in enumerate(told_by)]
    found = finished(lambda cell: told_by[cell.name], cells)
    row = maps(found)["inspect", "nes"]
    np.testing.assert_allclose(row["coverage"], [3 / 6, 3 / 6])
    np.testing.assert_allclose(row["largest_hole"], [3.3, 2.5])
    assert row["evaluations_a_vertex"].tolist() == [15.0, 15.0]
    assert findings(found)["maps"]["inspect"]["evolution"]["vertices"].startswith("2")
