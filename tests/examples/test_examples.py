# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest

import mobee

ROOT = Path(__file__).parents[2]
EXAMPLES = {path.stem.partition("_")[0]: path for path in sorted((ROOT / "examples").glob("[0-9]*.py"))}


def printed(number: str, folder: Path, *options: str) -> str:
    """What an example prints when it is run as a reader would, from any folder."""
    command = [sys.executable, str(EXAMPLES[number]), *options]
    ended = subprocess.run(
        command, cwd=folder, env={**os.environ, "OMP_NUM_THREADS": "1", "TMPDIR": str(folder)}, capture_output=True, text=True, timeout=280
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def numbers(pattern: str, text: str) -> list[float]:
    """The groups of the only place where the pattern matches."""
    (found,) = re.finditer(pattern, text)
    return [float(group) for group in found.groups()]


def test_each_example_has_its_own_number_and_fits_a_hundred_lines() -> None:
    assert list(EXAMPLES) == [f"{n:02d}" for n in range(1, 16)]
    assert {path.name: len(path.read_text().splitlines()) for path in EXAMPLES.values() if len(path.read_text().splitlines()) > 100} == {}


def test_01_prints_parts_limits_and_the_nearest_name(tmp_path: Path) -> None:
    text, robot = printed("01", tmp_path), mobee.load_robot("icub")
    for part in robot.parts.values():
        assert re.search(rf"{part.name} +{len(part)} motors, q\[{part.start}:{part.slice.stop}\]", text)
    for motor, limits in zip(robot.parts["left_arm"].motors, np.rad2deg(robot.limits[robot.parts["left_arm"].slice]), strict=True):
        assert numbers(rf"{motor} +(\S+) \.\. +(\S+) ", text) == pytest.approx(limits, abs=0.05)
    assert "Did you mean 'l_elbow'?" in text


def test_02_agrees_with_finite_differences(tmp_path: Path) -> None:
    text = printed("02", tmp_path)
    column = r"\[ *(\S+) +(\S+) +(\S+?) *\]"
    assert numbers(f"by {column} m a rad", text) == pytest.approx(numbers(f"differences say {column}", text), abs=1.1e-3)
    assert "positions (1000, 3), Jacobians (1000, 6, 41)" in text


def test_03_a_post_in_the_hand_touches_unless_it_is_a_ghost(tmp_path: Path) -> None:
    text = printed("03", tmp_path)
    count = r": (\d+) solid contacts, (\d+) of fields"
    assert numbers("at home" + count, text) == [0, 0]
    solids, fields = numbers("a post at the left palm" + count, text)
    assert solids > 0 and fields > 0
    assert numbers("the post as a ghost" + count, text) == [0, 0]
    assert numbers("the post as the target of right_palm" + count, text) == [solids, fields]
    assert numbers("the post as the target of left_palm" + count, text) == [0, 0]
    carried = mobee.load_robot("icub")
    low = carried.home.copy()
    low[carried.motor_index("l_shoulder_pitch")] = np.deg2rad(-20)
    palm = mobee.Model(carried).evaluate(low).position("left_palm")
    assert numbers(r"the post is at \[ *(\S+) +(\S+) +(\S+?) *\] m", text) == pytest.approx(palm, abs=1e-3)


def test_04_contact_forces_keep_the_hand_out_of_the_table(tmp_path: Path) -> None:
    (wanted,) = numbers(r"fingers (\S+) cm deep in it", text := printed("04", tmp_path))
    guarded, unguarded = numbers(r"went (\d+) mm into the table with the forces, (\d+) mm without", text)
    assert guarded == 0
    assert unguarded == pytest.approx(10 * wanted, abs=5)


def test_05_only_the_table_keeps_the_arm_from_its_target(tmp_path: Path) -> None:
    text = printed("05", tmp_path)
    outcome = r": settled after \S+ s, shoulder (\S+) deg from its target, touching "
    (up,) = numbers(f"^up{outcome}nothing", text)
    (into,) = numbers(f"\ninto the table{outcome}table", text)
    (again,) = numbers(f"\nup again{outcome}nothing", text)
    assert up < 2 and again < 2 and into > 4


def test_06_an_agent_continues_after_a_restart(tmp_path: Path) -> None:
    text = printed("06", tmp_path)
    observed = re.findall(r" (\d+): from +(\d+) towards +(\d+), got to +(\d+)", text)
    assert [int(n) for n, *_ in observed] == list(range(1, 11))
    assert [arrived for *_, arrived in observed[:-1]] == [start for _, start, *_ in observed[1:]]
    assert "a new one finds 10 transitions\nand has made 20 in all" in text


def test_07_counts_every_arrival(tmp_path: Path) -> None:
    text = printed("07", tmp_path)
    arrivals = [int(state) for state in re.findall(r"now in state (\d)", text)]
    assert len(arrivals) == 12
    visits = [int(n) for n in re.findall(r"\d+", text.rpartition("bottom:")[2])]
    assert visits == [arrivals.count(state) for state in range(9)]


@pytest.mark.system
@pytest.mark.untimed
def test_08_sees_the_left_arm_move_and_leaves_nothing_running(tmp_path: Path) -> None:
    text = printed("08", tmp_path)
    assert "agent_left_arm" in text and "robot_sim" in text
    assert [process.pid for process in psutil.process_iter(["cmdline"]) if str(tmp_path) in " ".join(process.info["cmdline"] or ())] == []
    line = r"tick (\d+): left arm armed, elbow at +\S+ deg, fastest motor +(\S+) deg/s"
    seen = [(int(k), float(speed)) for k, speed in re.findall(line, text)]
    ticks, speeds = zip(*seen, strict=True)
    assert len(seen) == 5 and list(ticks) == sorted(set(ticks))
    assert max(speeds) > 1


def test_09_reaches_what_is_in_reach_and_rests_before_what_is_not(tmp_path: Path) -> None:
    text = printed("09", tmp_path)
    assert numbers(r"in advance: reached after \d+ steps, (\S+) mm from", text)[0] <= 1.0
    outcome = r" s, palm (\S+) cm from the target, 0 solids touch"
    assert numbers(r"in front: reached after \S+" + outcome, text)[0] <= 0.5
    assert numbers(r"out of reach: stuck after \S+" + outcome, text)[0] > 10
    assert numbers(r"under the table's top: stuck after \S+" + outcome, text)[0] > 5


def test_10_plans_avoid_failing_actions(tmp_path: Path) -> None:
    text = printed("10", tmp_path)
    assert re.search(r"each of 432 state-actions was tried at least [1-9] times", text)
    naive, learned = (np.mean([int(n) for n in taken.split(",")]) for taken in re.findall(r"it took (.*) actions", text))
    assert learned < naive
    successes = [float(chance) for chance in re.findall(r"as expected with probability (\S+)", text)]
    assert successes[1] > 0.7 > successes[0]
    paths = [[int(state) for state in path.split(" -> ")] for path in re.findall(r"^  (\d+ -> [\d >-]+):", text, re.MULTILINE)]
    assert [(path[0], path[-1]) for path in paths] == [(start, 24) for start in (0, 40, 60, 80)]
    assert all(
        (before, after) not in ((15, 24), (42, 51), (69, 78)) for path in paths for before, after in zip(path, path[1:], strict=False)
    )


def test_11_reaches_a_place_never_tried_before(tmp_path: Path) -> None:
    text = printed("11", tmp_path)
    scores = [float(score) for score in re.findall(r"tries: (\S+) of 8", text)]
    assert len(scores) == 3 and all(3.0 < score < 8.0 for score in scores)
    missing, reward = numbers(r"state \d+: (\S+) mm remain, reward (\S+)", text)
    assert missing < 20.0 and reward == pytest.approx(1 / (1 + missing / 10), abs=0.01)


def test_12_explores_a_cliff_and_plans_along_it(tmp_path: Path) -> None:
    text = printed("12", tmp_path)
    assert len(re.findall(r"^state +\d+ after [1-9]\S* s, touching .*: gained 0\.\d+ nats$", text, re.MULTILINE)) == 5
    random, curious = (int(tried) for tried in re.findall(r"tried (\d+) of 152", text))
    assert random < curious == 152
    path = [int(state) for state in text.rpartition("cliff: ")[2].split(" -> ")]
    assert path == [36, *range(24, 36), 47]  # the shortest one


def test_13_learns_where_stable_baselines_is_installed(tmp_path: Path) -> None:
    compile(EXAMPLES["13"].read_text(), "13", "exec")
    pytest.importorskip("stable_baselines3")
    assert "0 steps: success" in printed("13", tmp_path, "0")


def test_14_learns_to_bring_the_hand_to_a_state(tmp_path: Path) -> None:
    text = printed("14", tmp_path)
    shares = [float(share) for share in re.findall(r"steps: (\S+) of the last 40 episodes", text)]
    assert shares[0] < 0.7 and min(shares[-2:]) > 0.9


def test_15_plans_push_the_cup_to_its_cell_more_often_than_random_actions(tmp_path: Path) -> None:
    text = printed("15", tmp_path)
    assert numbers(r"the cup was pushed (\S+) m and fell (\d+) times", text)[0] > 0.5
    planned, drawn = numbers(r"of 8 tries: (\d+) by plans, (\d+) by random", text)
    assert planned >= 6 and planned > drawn
