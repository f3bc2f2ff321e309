# SPDX-License-Identifier: Apache-2.0
"""`mobee play FILE` from the file of a robot to agents that continue live with the model that they have learned offline."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.kit.live.launch import free_endpoint
from mobee.store import STORE, TransitionStore
from tests.mobee_cli.test_learn import ARM


@pytest.mark.system
@pytest.mark.untimed
def test_a_robot_continues_live_from_offline_transitions(tmp_path: Path) -> None:
    arm = tmp_path / "arm.urdf"
    arm.write_text(ARM)
    command = [sys.executable, "-m", "mobee_cli", "play", str(arm), "--headless", "--transitions", "12", "--duration", "12", "--json"]
    command += ["--endpoint", free_endpoint(), "--runs", str(tmp_path / "runs"), "--save", str(tmp_path / "mine")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    run = Path(json.loads(done.stdout)["run"])
    with TransitionStore(run / STORE, "arm", read_only=True) as store:
        made, record = store.load(), store.settings()
    assert record["continued"]["transitions"] == 12
    assert record["continued"]["plant"]["dt"] == 0.02
    assert len(made) > 12
