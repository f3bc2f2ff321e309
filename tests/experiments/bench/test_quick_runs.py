# SPDX-License-Identifier: Apache-2.0
"""Every benchmark that runs in this process, at its smallest: it gives numbers as JSON, a verdict, and a report of 80 columns."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from experiments.bench import edges, gym, ik, model, nes, plant, trm, vi
from experiments.claims.ch3_roadmaps import trm as trm_claim
from mobee.roadmap.building.lattice_builder import Patience
from mobee_cli.bench import BENCHES

SMALLEST: dict[str, Any] = {
    "edges": edges.Settings(spacing=0.1, rounds=1),
    "gym": gym.Settings(steps=10, rounds=1),
    "ik": ik.Settings(targets=1, whole=1, rivals=1),
    "model": model.Settings(boxes=(0,), rounds=1, poses=5, other_poses=5, compared_boxes=(0,), compared_poses=2),
    "nes": nes.Settings(dimensions=(4,), runs=1),
    "plant": replace(plant.QUICK, actions=5, reaches=5, transitions=10, hashed=2, ticks=50, batched=1),
    "trm": trm.Settings(spacing=0.08, seeds=2, vertices=20, methods=(trm.LEAST_SQUARES,)),
    "vi": vi.Settings(problems=4, rounds=1, observations=2, large=200, large_rounds=1),
}
PEERS = {
    "gym": ("gymnasium", "mujoco", "imageio"),
    "ik": ("cma", "mink", "mujoco"),
    "model": ("mujoco", "pinocchio"),
    "nes": ("cma",),
    "plant": ("mujoco",),
    "vi": ("quantecon",),
}


@cache
def measured(name: str) -> dict[str, Any]:
    for package in PEERS.get(name, ()):
        pytest.importorskip(package)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trm_claim, "GENEROUS", Patience(starts=4, tries=2, scouts=64))
        patch.setattr(trm_claim, "RANDOM_POINTS", 20)
        patch.setattr(model, "_POSES_OF_THREADS", 10)
        result: dict[str, Any] = importlib.import_module(f"experiments.bench.{name}").measure(SMALLEST[name])
    return result


@pytest.mark.parametrize("name", SMALLEST)
def test_a_benchmark_gives_numbers_a_verdict_and_a_report(name: str) -> None:
    result = json.loads(json.dumps(measured(name)))
    assert result["requirements"] and all(isinstance(one["found"], float) for one in result["requirements"])
    conditions = result.get("agree", True) and result.get("same_hash", True)
    conditions = conditions and all(one["passed"] for one in result.get("agreement", []))
    assert result["passed"] == (conditions and all(one["passed"] for one in result["requirements"]))
    result["requirements"][0]["passed"] = False
    lines = importlib.import_module(f"experiments.bench.{name}").report(result).splitlines()
    assert max(map(len, lines)) <= 80
    verdicts = [line.split()[-1] for line in lines if line.endswith(("pass", "SHORT"))]
    assert verdicts == ["pass" if one["passed"] else "SHORT" for one in result["requirements"]]


def test_all_methods_of_checking_edges_agree_and_the_fast_ones_evaluate_fewer_poses() -> None:
    result = measured("edges")
    assert result["agree"]
    assert 0 < result["change_edges"] < result["edges"] and 0 < result["blocked"] <= result["change_edges"]
    assert result["once_poses"] < result["plain_poses"] and result["once_poses"] < result["both_poses"]


def test_completeness_and_validity_of_a_map_are_measured() -> None:
    result = measured("trm")
    row = result["rows"][trm.LEAST_SQUARES]
    assert row["vertices"] >= 20 and row["valid"] == 1.0 and len(result["requirements"]) == 5
    assert 0.9 < row["coverage"] <= 1.0 and 0.0 < row["largest_hole"] < 3.0
    assert 0.0 < row["short_edges"] <= 1.0 and row["processor_s"] > 0.0


def test_ratios_are_those_of_the_numbers_beside_them() -> None:
    rows = measured("nes")["rows"]
    assert [row["function"] for row in rows] == list(nes.FUNCTIONS) and all(row["ratio"] == row["nes"] / row["cma"] for row in rows)
    plans = measured("vi")
    assert plans["cold_times_scipy"] == pytest.approx(plans["us"]["SciPy sparse, cold"] / plans["us"]["ours, cold"])
    assert plans["warm_times_quantecon"] == pytest.approx(plans["us"]["quantecon value iteration"] / plans["us"]["ours, warm"])
    assert all(one["passed"] for one in plans["requirements"] if one["name"].startswith("largest"))


@pytest.mark.parametrize("name", BENCHES)
def test_the_command_finds_settings_measurement_and_report(name: str) -> None:
    module = importlib.import_module(f"experiments.bench.{name}")
    bench = BENCHES[name]
    assert callable(module.measure) and callable(module.report)
    assert (bench.quick is not None) == hasattr(module, "QUICK")
    dest = {str(details.get("dest", option.lstrip("-"))).replace("-", "_") for option, details in (bench.options or {}).items()}
    assert dest <= module.Settings.__dataclass_fields__.keys()
