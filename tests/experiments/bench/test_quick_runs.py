# SPDX-License-Identifier: Apache-2.0
"""Every benchmark that runs in this process, at its smallest: it gives numbers as JSON, a verdict, and a report of 80 columns."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
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
    "trm": trm.Settings(spacing=0.1, vertices=10, methods=(trm.LEAST_SQUARES,)),
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


@pytest.mark.parametrize("name", SMALLEST)
def test_a_benchmark_gives_numbers_a_verdict_and_a_report(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in PEERS.get(name, ()):
        pytest.importorskip(package)
    monkeypatch.setattr(trm_claim, "GENEROUS", Patience(starts=4, tries=2, scouts=64))
    monkeypatch.setattr(trm_claim, "RANDOM_POINTS", 20)
    monkeypatch.setattr(model, "_POSES_OF_THREADS", 10)
    module = importlib.import_module(f"experiments.bench.{name}")
    result = json.loads(json.dumps(module.measure(SMALLEST[name])))
    assert result["requirements"] and all(isinstance(one["found"], float) for one in result["requirements"])
    conditions = result.get("agree", True) and result.get("same_hash", True)
    conditions = conditions and all(one["passed"] for one in result.get("agreement", []))
    assert result["passed"] == (conditions and all(one["passed"] for one in result["requirements"]))
    result["requirements"][0]["passed"] = False
    lines = module.report(result).splitlines()
    assert max(map(len, lines)) <= 80
    verdicts = [line.split()[-1] for line in lines if line.endswith(("pass", "SHORT"))]
    assert verdicts == ["pass" if one["passed"] else "SHORT" for one in result["requirements"]]


@pytest.mark.parametrize("name", BENCHES)
def test_the_command_finds_settings_measurement_and_report(name: str) -> None:
    module = importlib.import_module(f"experiments.bench.{name}")
    bench = BENCHES[name]
    assert callable(module.measure) and callable(module.report)
    assert (bench.quick is not None) == hasattr(module, "QUICK")
    dest = {str(details.get("dest", option.lstrip("-"))).replace("-", "_") for option, details in (bench.options or {}).items()}
    assert dest <= module.Settings.__dataclass_fields__.keys()
