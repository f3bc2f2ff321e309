# SPDX-License-Identifier: Apache-2.0
"""Every block of code in README.md, CONTRIBUTING.md and docs/: Python runs, commands parse, files are well-formed.

A block that is a file (a fence with a second word) or that has a test of its own is in test_documentation.py or test_add_a_force.py.
"""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from mobee_cli.__main__ import VERBS, main, parser_of

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md")), ROOT / "mobee/robot/robots/README.md"]

TABLE = """
import numpy as np, mobee
robot = mobee.load_robot("icub")
model = mobee.Model(robot, mobee.load_world("table"))
"""

GIVEN = {
    "docs/behaviours.md": "",
    "docs/control.md": "",
    "docs/cup.md": "",
    "docs/gymnasium.md": "",
    "docs/installation.md": "",
    "docs/law.md": TABLE + "q = goal = robot.home\nf, wrench = np.zeros(41), np.zeros(6)\n",
    "docs/model.md": "",
    "docs/play.md": "",
    "docs/reach.md": "",
    "docs/reaching.md": TABLE
    + """
from pathlib import Path
from mobee.learning.reaching.store import ReachStore
arm = [f"r_shoulder_{axis}" for axis in ("pitch", "roll", "yaw")] + ["r_elbow"]
space, plant = mobee.Lattice(robot, joints=arm), mobee.OfflinePlant(model, seed=0)
beliefs = mobee.TransitionModel(space)
target = mobee.ReachTarget([-0.3, 0.2, 0.1])
targets, see = [target], lambda: None
goal, poses = plant.measure("right_arm"), robot.home + np.zeros((3, 1))
""",
    "docs/vision.md": "",
    "docs/roadmaps.md": TABLE + "start, goals = robot.home, robot.home + 0.05 * np.eye(41)[robot.motor_index('r_elbow')]\n",
}
"""Pages whose Python blocks run here, one after the other, and what the text presumes before the first."""

ELSEWHERE = {
    "README.md": "test_documentation.py",
    "docs/agents.md": "test_documentation.py",
    "docs/learning.md": "test_documentation.py",
    "docs/plant.md": "test_documentation.py",
    "docs/robots.md": "test_documentation.py",
    "docs/bus.md": "not run: part of a service, whose own names stand for any",
}

RUN_HERE = (
    "mobee roadmap tasks",
    "mobee roadmap build palm-down -o palm.npz",
    "mobee roadmap query palm.npz --to -0.3 0.2",
    "mobee roadmap play palm.npz --to -0.3 0.2 --from -0.4 0",
    "mobee reach --target -0.3 0.2 0.1 --offline --json",
    "mobee experiment run hypercube-exploration",
    "mobee learn --robot katana --transitions 200 --store katana.sqlite",
    "mobee plan --run katana.sqlite --to 8",
)
"""Commands on the pages that run here in this order, in one folder."""

QUICKER = {
    "mobee roadmap build palm-down -o palm.npz": "--method least_squares",  # tests/mobee/roadmap tests all methods
    "mobee experiment run hypercube-exploration": "--seeds 2",
}
"""Options with which a command takes a second instead of many."""

RUN_ELSEWHERE = {
    r"./launch": "tests/services/launcher/test_run.py",
    r"./test.*": "is what runs this test",
    r"pip install .": "tests/packaging/test_wheel.py",
    r"pip install (\"mobee\[planning\]\"|--target (erd|zoo) .*)": "needs a package index",
    r"mobee launch reach": "tests/services/launcher/test_scenario.py",
    r"mobee launch kinematic --camera .*": "tests/services/launcher/test_scenario.py",
    r"mobee launch lockstep --ticks 3000": "tests/system/test_recorder.py",
    r"mobee launch lockstep --page --runs runs": "tests/services/launcher/test_run.py",
    r"mobee launch eyes( --set .*)?": "tests/system/test_calibrate.py",
    r"mobee launch gaze.*": "tests/system/test_gaze.py",
    r"mobee launch cup": "tests/system/test_cup.py",
    r"mobee calibrate .*": "tests/mobee_cli/test_calibrate.py",
    r"mobee detector train .*": "tests/mobee_cli/test_detector.py",
    r"mobee keys new": "tests/mobee_cli/test_keys.py",
    r"mobee keys add launcher_desk": "tests/mobee_cli/test_keys.py",
    r"mobee launch --secure.*": "tests/system/test_intruders.py",
    r"mobee launch --(elsewhere|join) .*": "needs a second host: tests/services/launcher/test_hosts.py, tests/system/test_network.py",
    r"mobee status( --endpoint tls/robot:7447)?": "tests/mobee_cli/test_status.py",
    r"mobee record --to FOLDER": "needs a system that was started without a launcher",
    r"mobee launch filtered": "tests/services/port_filter/test_process.py",
    r"mobee reach --target [-. 0-9]+": "tests/system/test_reach.py",
    r"mobee reach --target [-. 0-9]+ --facing": "tests/mobee_cli/test_reach.py",
    r"mobee reach --object ball --stay": "never ends; test_reach.py of mobee_cli and test_reaches.py of the controller test --stay",
    r"mobee reach --target [-. 0-9]+ --run .*": "tests/mobee_cli/test_reach.py",
    r"mobee reach --offline --robot pointer.xml .*": "tests/mobee_cli/test_reach.py",
    r"mobee roadmap build palm-down": "runs here with a file's name",
    r"mobee roadmap show palm.npz( --view)?": "tests/mobee_cli/test_roadmap.py",
    r"mobee roadmap play palm.npz --to [-. 0-9]+ --live": "tests/system/test_reach.py",
    r"mobee roadmap (build own_task.py|show own_task.npz|build sweep.py|show sweep.npz).*": "tests/examples/test_documentation.py",
    r"mobee play.*": "tests/mobee_cli/test_play.py",
    r"mobee replay .*": "tests/mobee_cli/test_replay.py",
    r"mobee film .*": "tests/mobee_cli/test_film.py",
    r"mobee plan .*": "tests/mobee_cli/test_plan.py",
    r"mobee router": "tests/mobee_cli/test_verbs.py",
    r"(mobee conform|python examples/bus/own_robot.py) --robot my_arm.xml": "tests/mobee_cli/conform/test_conform.py",
    r"mobee check .*": "tests/mobee_cli/test_check.py",
    r"mobee convert .*": "tests/mobee_cli/test_convert.py",
    r"mobee bench against .*": "tests/experiments/bench/test_against.py",
    r"mobee experiment (run|figure) .*": "tests/experiments/test_registry.py",
    r"python -m experiments.claims.ch8_reaching.reach_film .*": "tests/experiments/claims/ch8_reaching/test_reach_film.py",
}
"""All other commands on the pages, as patterns: the test that runs the command in short, or why none does."""

SHORTER = {
    "tries=400": "tries=4",
    "repetitions=5": "repetitions=1",
    "spacing=0.02": "spacing=0.05",
    "milestones=300": "milestones=100",
    'views=("oblique", "top")': 'views=("top",), poses=1',
    'Path("cloud.png")': 'Path("cloud.png"), views=("top",)',
}
"""Numbers with which a block would take a minute, and pictures of which one is as good as six."""


@dataclass(frozen=True)
class Block:
    page: str
    line: int
    language: str
    name: str
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks_of(path: Path) -> list[Block]:
    text, page = path.read_text(), path.relative_to(ROOT).as_posix()
    found = re.finditer(r"^```(\w*) ?(\S*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [Block(page, text[: one.start()].count("\n") + 1, *one.groups()) for one in found]


BLOCKS = [block for path in PAGES for block in blocks_of(path)]
PYTHON = [block for block in BLOCKS if block.language == "python" and not block.name]


def test_every_block_is_of_a_known_language() -> None:
    assert {block.language for block in BLOCKS} <= {"", "console", "sh", "python", "toml", "xml", "json", "yaml", "cpp"}


def test_every_python_block_runs_here_or_has_a_reason() -> None:
    assert {block.page for block in PYTHON} == GIVEN.keys() | ELSEWHERE.keys()


@pytest.mark.parametrize("page", GIVEN)
def test_the_python_blocks_of_a_page_run(page: str, tmp_path: Path) -> None:
    for block in BLOCKS:
        if block.page == page and block.name:
            (tmp_path / block.name).write_text(block.text)
    program = GIVEN[page] + "\n".join(block.text for block in PYTHON if block.page == page)
    for long, short in SHORTER.items():
        program = program.replace(long, short)
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr


def commands() -> list[tuple[str, str]]:
    """The command lines on the pages, each with its place; a line of a console's output begins with no `$`."""
    found = []
    for block in BLOCKS:
        if block.language in {"", "sh", "console"}:
            lines = [
                line.removeprefix("$ ")
                for line in block.text.replace("\\\n", " ").splitlines()
                if line.startswith("$ ") or "$ " not in block.text
            ]
            found += [(str(block), line) for line in lines if re.match(r"(mobee|python|pip|\./\w+) ", line)]
    return found


@pytest.mark.parametrize(("place", "line"), commands())
def test_a_command_on_a_page_is_one_that_its_program_accepts(place: str, line: str) -> None:
    program, *words = shlex.split(line, comments=True)
    words = words[: words.index("&&")] if "&&" in words else words
    match program:
        case "mobee":
            assert words[0] in VERBS, place
            parser_of(words[0]).parse_args(words[1:])  # ends the test with its message if it refuses them
        case "python":
            assert importlib.util.find_spec(words[1]) if words[0] == "-m" else (ROOT / words[0]).is_file(), place
        case "pip":
            extras = re.findall(r"\[(\w+)\]", line)
            declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
            assert set(extras) <= declared.keys(), place
        case _:
            assert (ROOT / program).is_file(), place


def without_comment(line: str) -> str:
    return line.partition(" #")[0].strip()


def test_the_quick_commands_on_the_pages_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """In this process: to start another for each takes longer than most commands."""
    on_pages = {without_comment(line) for _, line in commands()}
    assert set(RUN_HERE) <= on_pages
    monkeypatch.chdir(tmp_path)
    for line in RUN_HERE:
        code, printed = main(shlex.split(f"{line} {QUICKER.get(line, '')}")[1:]), capsys.readouterr()
        assert code == 0, f"{line}: {printed.err}"
        assert printed.out.strip(), line


def test_every_other_command_has_a_test_or_a_reason() -> None:
    others = {without_comment(line) for _, line in commands()} - set(RUN_HERE)
    covered = {line: [pattern for pattern in RUN_ELSEWHERE if re.fullmatch(pattern, line)] for line in others}
    assert [line for line, patterns in covered.items() if not patterns] == []
    assert RUN_ELSEWHERE.keys() == {pattern for patterns in covered.values() for pattern in patterns}
    assert [place for place in RUN_ELSEWHERE.values() if place.startswith("tests/") and not (ROOT / place).is_file()] == []


@pytest.mark.parametrize("block", [block for block in BLOCKS if block.language in {"toml", "json"}], ids=str)
def test_a_file_on_a_page_is_well_formed(block: Block) -> None:
    (tomllib if block.language == "toml" else json).loads(block.text)


def test_measured_intervals_on_the_pages_are_those_of_the_records() -> None:
    """`0.26 [0.19, 0.35]` on a page is in the records of the claims, with at least as many digits."""
    number = r"-?\d*\.?\d+"
    interval = re.compile(rf"({number}) \[({number}), ({number})\]")
    recorded = [tuple(map(float, found)) for found in interval.findall((ROOT / "experiments/claims.json").read_text())]
    missing = set()
    for page in ("README.md", "docs/results.md"):
        for found in interval.finditer((ROOT / page).read_text()):
            digits = len(found[1].partition(".")[2])
            shown = tuple(map(float, found.groups()))
            if not any(max(abs(a - b) for a, b in zip(shown, one, strict=True)) <= 0.51 * 10**-digits for one in recorded):
                missing.add(f"{page}: {found[0]}")
    assert missing == set()
