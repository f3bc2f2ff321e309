# SPDX-License-Identifier: Apache-2.0
"""The code in README.md and in docs/ runs as it stands: a fence with a second word is a file of that name."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.kit.live.launch import stop
from services.common.session import open_client

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: str, folder: Path) -> list[str]:
    """The Python blocks of a page; its named blocks are written into the folder."""
    found = re.findall(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE)
    for _, name, text in found:
        if name:
            (folder / name).write_text(text)
    return [text for language, name, text in found if language == "python" and not name]


def run(folder: Path, *arguments: str) -> str:
    ended = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, timeout=280)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def launch(folder: Path, scenario: str, endpoint: str, *options: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "mobee_cli", "launch", scenario, "--headless", "--endpoint", endpoint, *options]
    return subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL, stdout=subprocess.PIPE, process_group=0)


def test_the_main_flow_in_the_readme_runs(tmp_path: Path) -> None:
    (main_flow,) = blocks("README.md", tmp_path)
    palm, transition = run(tmp_path, "-c", main_flow).splitlines()
    assert re.match(r"\[ *-0\.3038\d* +-0\.1499\d* +0\.0299\d*\] \(\)$", palm)
    assert transition.startswith("Transition(n=3, ") and transition.endswith(" 3")


def test_the_readers_own_robot_learns(tmp_path: Path) -> None:
    flow, _, _ = blocks("docs/robots.md", tmp_path)
    motors, transition = run(tmp_path, "-c", flow).splitlines()
    assert motors.startswith("('pan', 'bend') [")
    assert transition.startswith("Transition(n=10, ")


def test_the_documented_weight_of_a_robot_is_printed(tmp_path: Path) -> None:
    _, _, masses = blocks("docs/robots.md", tmp_path)
    torque, energy = map(float, run(tmp_path, "-c", masses).splitlines())
    assert 0.0 < abs(torque) < 5.0  # N m, an elbow of a small robot
    assert 10.0 < energy < 100.0  # J above the waist


def test_plans_use_the_transitions_learned_on_the_page(tmp_path: Path) -> None:
    (flow,) = blocks("docs/learning.md", tmp_path)
    run(tmp_path, "-c", flow)
    planned = run(tmp_path, "-m", "mobee_cli", "plan", "--run", ".", "--from", "0", "--to", "26")
    assert planned.startswith("torso, by 300 transitions: from state 0 to 26 by ")


def test_an_explorer_of_the_reader_explores(tmp_path: Path) -> None:
    flow, _ = blocks("docs/agents.md", tmp_path)
    assert run(tmp_path, "-c", flow) == "my_explorers:stubborn 20\n"


def test_an_agent_learns_where_a_cup_is(tmp_path: Path) -> None:
    _, flow = blocks("docs/agents.md", tmp_path)
    printed = run(tmp_path, "-c", flow)
    assert printed.startswith("<ObjectSpace of left_arm and cup: 9 postures x 4 cells> ") and printed.endswith(
        " [27 28 29 30 31 32 33 34 35]\n"
    )


def test_an_arm_acts_on_the_offline_plant(tmp_path: Path) -> None:
    flow, _, _ = blocks("docs/plant.md", tmp_path)
    assert run(tmp_path, "-c", flow).split() == ["True", "(100,", "41)", "True", "64"]


def test_many_plants_continue_together(tmp_path: Path) -> None:
    _, many, _ = blocks("docs/plant.md", tmp_path)
    assert run(tmp_path, "-c", many).strip() == "[True, True, True] (100, 41)"


def test_a_cup_that_nothing_touches_stays(tmp_path: Path) -> None:
    _, _, flow = blocks("docs/plant.md", tmp_path)
    assert run(tmp_path, "-c", flow).split() == ["[-0.3", "-0.15", "-0.055]", "0.0", "0"]


def test_the_findings_of_a_robot_are_as_documented(tmp_path: Path) -> None:
    _, check, _ = blocks("docs/robots.md", tmp_path)
    assert [line.split(" ", 2)[:2] for line in run(tmp_path, "-c", check).splitlines()] == [
        ["error", "slips.xml:3"],
        ["warning", "slips.xml:5"],
        ["note", "slips.xml:8"],
        ["note", "slips.xml:1"],
    ]
    printed = re.search(r"^\$ mobee check slips\.xml\n(.*?)^\.\.\.$", (ROOT / "docs/robots.md").read_text(), re.DOTALL | re.MULTILINE)
    assert printed
    done = subprocess.run([sys.executable, "-m", "mobee_cli", "check", "slips.xml"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stdout.startswith(printed[1])


def test_the_readers_own_robot_gets_a_map_of_its_own_task(tmp_path: Path) -> None:
    blocks("docs/robots.md", tmp_path)
    robot = ("--robot", "pointer.xml")
    summary = run(tmp_path, "-m", "mobee_cli", "roadmap", "build", "sweep.py", *robot, "--world", "desk.xml")
    assert re.match(r"sweep\.npz: [1-9]\d+ poses", summary) and "(desk, ball)" in summary
    assert "tip" in run(tmp_path, "-m", "mobee_cli", "roadmap", "show", "sweep.npz", *robot)
    run(tmp_path, "-m", "mobee_cli", "reach", "--offline", *robot, "--world", "desk.xml", "--object", "ball")


def test_the_task_file_to_copy_builds_a_map(tmp_path: Path) -> None:
    blocks("docs/roadmaps.md", tmp_path)
    summary = run(tmp_path, "-m", "mobee_cli", "roadmap", "build", "own_task.py", "--method", "least_squares")
    assert re.match(r"own_task\.npz: [1-9]\d+ poses", summary)


@pytest.mark.system
@pytest.mark.untimed
def test_the_readers_own_robot_runs_live(tmp_path: Path, free_port: int) -> None:
    blocks("docs/robots.md", tmp_path)
    launcher = launch(tmp_path, "pointer.toml", f"tcp/127.0.0.1:{free_port}", "--duration", "5")
    try:
        summary = launcher.communicate(timeout=120)[0].decode()
    finally:
        stop(launcher)
    assert launcher.returncode == 0, summary
    assert re.search(r"^  arm +\d+ transitions", summary, re.MULTILINE)


@pytest.mark.system
@pytest.mark.untimed
def test_the_readers_own_agent_moves_the_free_arm(tmp_path: Path, free_port: int) -> None:
    blocks("docs/agents.md", tmp_path)
    endpoint = f"tcp/127.0.0.1:{free_port}"
    launcher = launch(tmp_path, "free_arm.toml", endpoint, "--set", "services.robot_sim.rate=50")
    try:
        open_client(endpoint, patience=60.0).close()  # its router is there
        assert run(tmp_path, "my_agent.py", endpoint).startswith("Transition(n=2, ")
    finally:
        stop(launcher)


def anchors(page: Path) -> set[str]:
    """The headings of a page, as links name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_lead_to_files_and_headings_of_the_project(page: Path) -> None:
    wrong = []
    for target, _, heading in (link.partition("#") for link in re.findall(r"\]\((?!https?://)([^)]+)\)", page.read_text())):
        path = page.parent / target if target else page
        if not path.exists() or (heading and heading not in anchors(path)):
            wrong.append(f"{target}#{heading}")
    assert wrong == []


def test_the_index_names_every_page() -> None:
    index = (ROOT / "docs/index.md").read_text()
    assert [page.name for page in (ROOT / "docs").glob("*.md") if page.name != "index.md" and f"({page.name}" not in index] == []


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150


def test_the_page_of_commands_names_every_command_and_no_other() -> None:
    page = (ROOT / "docs/commands.md").read_text()
    done = subprocess.run([sys.executable, "-m", "mobee_cli", "--help"], capture_output=True, text=True).stdout
    verbs = set(re.findall(r"^  (\w+) ", done, re.MULTILINE))
    named = set(re.findall(r"`mobee ([a-z]+)", page + (ROOT / "README.md").read_text()))
    assert named <= verbs
    assert [verb for verb in verbs if not re.search(rf"`(mobee )?{verb}\b", page)] == []


def test_the_keys_in_the_diagram_of_the_architecture_are_those_of_the_bus() -> None:
    diagram = re.findall(r"^```\n(.*?)^```$", (ROOT / "docs/architecture.md").read_text(), re.DOTALL | re.MULTILINE)[0]
    keys = set(re.findall(r"[\w{}]+/[\w{}/]+", diagram)) | {"tick", "commands"}
    bus = (ROOT / "docs/bus.md").read_text().replace("<", "{").replace(">", "}")
    assert {key for key in keys if f"`{key}`" not in bus and f"`{key.rpartition('/')[0]}/" not in bus} == set()
