# SPDX-License-Identifier: Apache-2.0
"""A crossing is timed on robot_sim's ticks, and the turn by the simulator's joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.claims.ch3_roadmaps import replanning
from experiments.claims.ch3_roadmaps.replanning import CLAIMS, findings, keep_poses, measure, read_measured
from experiments.claims.ch3_roadmaps.replanning_live import ABOVE, LEFT, PART, RIGHT, Acted, Crossing, Job, ball, model, new_map, robot
from experiments.kit.live.launch import append_done, read_job, write_job
from experiments.kit.live.system import CONTACTS, POSITIONS
from mobee.errors import InvalidValue

ARM = robot().parts[PART].slice
BUMP, TURN, END = 40, 52, 120


def acted(vertex: int, asked: int, bump: int, ended: int) -> Acted:
    return Acted(vertex, asked, asked + 2, bump, ended, 1e-3)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The arm moves straight to the left vertex until tick 52, and then back."""
    space = new_map().space
    motion = space.target(LEFT) - space.target(RIGHT)
    q = np.repeat(robot().home[None], END, axis=0)
    for k in range(2, END):
        gone = min(k - 2, TURN - 2) - max(k - TURN, 0)
        q[k - 2, ARM] = space.target(RIGHT) + 0.005 * gone * motion
    q.tofile(tmp_path / POSITIONS)
    (tmp_path / CONTACTS).write_text("k,pair,depth\n30,r_hand ball,0.001\n31,r_hand table,0.004\n")
    write_job(tmp_path, Job([0.1]))
    motions = [acted(LEFT, 10, BUMP, 41), acted(ABOVE, 41, -1, 80), acted(LEFT, 80, -1, END)]
    append_done(tmp_path, Crossing(20, motions))
    append_done(tmp_path, Crossing(20, [acted(LEFT, 10, -1, 50)]))
    append_done(tmp_path, Crossing(20, [acted(LEFT, 10, BUMP, 50)]))
    return tmp_path


def test_bump_command_turn_and_contacts(folder: Path) -> None:
    first, through, ended = measure(folder)
    assert first.bumped and first.arrived and first.on == [LEFT, ABOVE, LEFT]
    assert first.command == pytest.approx(30.0) and first.turn == pytest.approx(10.0 * (TURN - BUMP))
    assert first.deepest == pytest.approx(1e-3) and first.seconds == pytest.approx(1.1)
    assert not through.bumped and through.arrived
    assert ended.bumped and not ended.arrived and np.isinf([ended.command, ended.turn]).all()
    assert read_measured(folder) == [first, through, ended]
    assert read_job(folder, Job) == Job([0.1])


def test_few_crossings_leave_the_claims_open_and_slow_ones_refute_them(folder: Path) -> None:
    first = measure(folder)[0]
    assert {claim["verdict"] for claim in findings([first])["claims"]} == {"open"}
    verdicts = [claim["verdict"] for claim in findings(10 * [first])["claims"]]
    assert verdicts == ["confirmed", "met", "met"] and len(verdicts) == len(CLAIMS)
    lost = findings([*10 * [first], measure(folder)[2]])["claims"]
    assert [claim["verdict"] for claim in lost] == ["not reproduced", "not met", "met"]


def test_the_short_path_leads_through_the_ball_and_the_long_one_beside_it() -> None:
    roadmap, known = new_map(), model()
    assert roadmap.plan(RIGHT, LEFT) == (RIGHT, LEFT)
    roadmap.observe(RIGHT, 0, RIGHT)
    assert roadmap.plan(RIGHT, LEFT) == (RIGHT, ABOVE, LEFT)
    known.world.set_role("ball", "obstacle")
    shares = np.linspace(0.0, 1.0, 25)[:, None]

    def touches(start: int, end: int) -> bool:
        q = np.repeat(robot().home[None], len(shares), axis=0)
        q[:, ARM] = roadmap.space.target(start) + shares * (roadmap.space.target(end) - roadmap.space.target(start))
        return any("ball" in (contact.first, contact.second) for row in q for contact in known.evaluate(row).contacts)

    assert touches(RIGHT, LEFT) and not touches(RIGHT, ABOVE) and not touches(ABOVE, LEFT)
    assert np.allclose(ball(), known.world.objects["ball"].position)


def test_the_pictures_are_drawn(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(replanning, "filmstrip", lambda strips, path, height: path)
    measure(folder)
    keep_poses(folder)
    folder.rename(folder.with_name("launch-000"))
    run = folder.parent
    assert replanning.EXPERIMENT.method.figure(run).name == "replanning.png"
    assert (run / "replanning-times.png").exists()
    (run / "launch-000" / replanning.POSES).unlink()
    with pytest.raises(InvalidValue, match=r"has no launch-\*/poses.npz, .*: begin a new run without --resume"):
        replanning.EXPERIMENT.method.figure(run)
