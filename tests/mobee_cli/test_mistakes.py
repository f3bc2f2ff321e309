# SPDX-License-Identifier: Apache-2.0
"""Typical mistakes of new users: each error has a few lines: the fault, its place, the valid values, and the remedy.

A second launch, Ctrl-C, a missing compiler and a store of other settings need processes: tests/services/launcher/test_run.py,
test_main.py, tests/core/test_build.py and tests/services/test_agents.py.
"""

from __future__ import annotations

import importlib.util
import os
import resource
import shutil
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mobee import CuriousAgent, Lattice, load_robot
from mobee.learning.tabular import TabularPlant
from mobee.robot.load import ROBOTS
from mobee.store import STORE, TransitionStore
from mobee_cli.__main__ import main

ROOT = Path(__file__).parents[2]
BAD_INPUT, ENVIRONMENT = 2, 3
URDF = (
    '<robot name="arm"><link name="base"/><link name="tip">{collision}</link><joint name="turn" type="revolute"><parent link="base"/>'
    '<child link="tip"/><axis xyz="0 0 1"/><limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint></robot>'
)
SPHERE = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
MESH = '<collision><geometry><mesh filename="package://my_arm/meshes/tip.stl"/></geometry></collision>'
FILES = {
    "degrees.urdf": URDF.format(collision=SPHERE, low=-90, high=90),
    "arm.urdf": URDF.format(collision=SPHERE, low=-1.5, high=1.5),
    "mesh.urdf": URDF.format(collision=MESH, low=-1.5, high=1.5),
    "empty.urdf": "",
    "truncated.xml": '<?xml version="1.0"?>\n<ZeroPositionKinematicTree version="2.0" robotName="arm">\n <bodypart name="arm">\n',
    "picture.png": "\x89PNG\r\n\x1a\n",
    "later.xml": '<ZeroPositionKinematicTree version="9.0" robotName="arm"></ZeroPositionKinematicTree>',
    "unknown_field.toml": "[services.robot_sim]\n# comment\nrat = 50\n",
    "wrong_type.toml": '[services.robot_sim]\nrate = "fast"\n',
    "unknown_service.toml": "[services.robot_sin]\n",
    "no_services.toml": 'title = "nothing"\n',
    "syntax.toml": "[services.robot_sim\n",
    "binary.npz": "\x00\x01\x02 no archive",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder with files in various states of disrepair, and the run of a torso."""
    made = tmp_path_factory.mktemp("user")
    for name, text in FILES.items():
        (made / name).write_text(text, encoding="latin-1")
    (made / "folder.urdf").mkdir()
    (made / "no_store").mkdir()
    (made / "run").mkdir()
    space = Lattice(load_robot("icub"), ["torso_yaw", "torso_roll", "torso_pitch"])
    certain = (space.goals >= 0)[:, :, None].astype(float)
    with TransitionStore(made / "run" / STORE, "torso") as store:
        CuriousAgent(space, TabularPlant(space, np.maximum(space.goals, 0)[:, :, None], certain, start=13), store=store).run(20)
    return made


@dataclass(frozen=True)
class Mistake:
    """A command line, and parts of the answer."""

    words: str
    says: tuple[str, ...]
    code: int = BAD_INPUT


MISTAKES = (
    Mistake("lanch", ("unknown verb 'lanch'. Did you mean 'launch'?", "Valid: play, launch, keys, status")),
    Mistake("status --jsn", ("unrecognized arguments: --jsn", "see `mobee status --help`")),
    # names
    Mistake("check iccub", ("unknown robot or world 'iccub'. Did you mean 'icub'?",)),
    Mistake("view table", ("unknown robot 'table'", "It is a world: `mobee view icub --world table`")),
    Mistake("launch kinematc", ("unknown scenario 'kinematc'. Did you mean 'kinematic'?", "Or give the path of a .toml file")),
    Mistake("launch kinematic --set shared.robot=icubb", ("unknown robot 'icubb'. Did you mean 'icub'?", "--set shared.robot=icubb")),
    Mistake("launch kinematic --set shared.world=tabel", ("unknown world 'tabel'. Did you mean 'table'?",)),
    Mistake(
        "launch kinematic --set services.agent_torso.explorer=curios",
        ("--set services.agent_torso.explorer=curios", "unknown explorer 'curios'. Did you mean 'curious'?"),
    ),
    Mistake(
        "launch kinematic --set services.agent_torso.joints=['torso_yaww']", ("torso has no motor 'torso_yaww'. Did you mean 'torso_yaw'?",)
    ),
    Mistake(
        "launch kinematic --set shared.robot=katana",
        ("the robot has no part 'torso'. Valid: arm.", "as [services.agent_arm]: write a scenario for this robot"),
    ),
    Mistake("reach --offline --target -0.3 0.2 0.1 --marker left_plam", ("unknown marker 'left_plam'. Did you mean 'left_palm'?",)),
    Mistake("reach --offline --target -0.3 0.2 0.1 --part left_am", ("unknown part 'left_am'. Did you mean 'left_arm'?",)),
    Mistake("reach --offline --object bal", ("'bal'. Did you mean 'ball'?",)),
    Mistake("roadmap build palm-dwn", ("unknown task 'palm-dwn'. Did you mean 'palm-down'?", "or the path of your own .py file")),
    Mistake("experiment run hypercub", ("unknown experiment 'hypercub'. Did you mean 'hypercube-exploration'?",)),
    Mistake("experiment run", ("required: NAME; see",)),
    Mistake("plan --run run --agent tors --to 3", ("unknown agent 'tors'. Did you mean 'torso'?",)),
    Mistake("topic schema {part}/stat", ("no message of the bus has the key '{part}/stat'. Did you mean '{part}/state'?",)),
    # robot and world files
    Mistake("check degrees.urdf", ("degrees.urdf:1: warning: joint 'turn' turns -5157 to 5157 deg", "degrees were perhaps written"), 1),
    Mistake("check mesh.urdf", ("mesh.urdf:1:", "no mesh 'package://my_arm/meshes/tip.stl'", "ROS_PACKAGE_PATH")),
    Mistake("launch kinematic --set shared.robot=mesh.urdf", ("no mesh 'package://my_arm/meshes/tip.stl'",)),
    Mistake("check empty.urdf", ("empty.urdf:1:", "The file ends too early")),
    Mistake("check truncated.xml", ("truncated.xml:4:", "The file ends too early")),
    Mistake("check picture.png", ("picture.png:1: not well-formed XML", "Give a robot, world or mesh file")),
    Mistake("check folder.urdf", ("folder.urdf: is a folder", "Give the path of a .xml or .urdf file in it")),
    Mistake("check nofile.urdf", ("nofile.urdf: no such file", "or a name: icub")),
    Mistake("check later.xml", ("later.xml:1:", "'9.0' is not known", "Valid: 0.1, 1.0, 2.0")),
    Mistake("check icub --field 0.03", ("field= is for URDF and MJCF files only",)),
    Mistake("convert icub out.txt", ("out.txt: OUT must end in .xml or .urdf",)),
    Mistake("convert icub nowhere/icub.urdf", ("there is no folder", "nowhere: create it")),
    Mistake("convert arm.urdf mesh.urdf", ("mesh.urdf exists already", "overwrite it with --force")),
    Mistake("view icub --save icub.mp4", ("recordings must have a name that ends in .rrd",)),
    # scenario files and settings
    Mistake("launch nofile.toml", ("nofile.toml: no such file", "or a shipped scenario: ")),
    Mistake("launch arm.urdf", ("the file of a robot or a world, not a scenario", "--set shared.robot=arm.urdf")),
    Mistake("launch unknown_field.toml", ("unknown_field.toml:3: unknown field 'services.robot_sim.rat'. Did you mean 'rate'?",)),
    Mistake("launch wrong_type.toml", ("wrong_type.toml:2: services.robot_sim.rate: Expected a number, got a text",)),
    Mistake("launch unknown_service.toml", ("unknown_service.toml:1: unknown service 'robot_sin'. Did you mean 'robot_sim'?",)),
    Mistake("launch no_services.toml", ("no services: name at least one as [services.<name>]",)),
    Mistake("launch syntax.toml", ("syntax.toml: not TOML", "line 1")),
    Mistake("launch kinematic --set robot=icub", ("--set robot=icub: write it as table.field=value",)),
    Mistake("launch kinematic --set services.robot_sim.rate=-1", ("services.robot_sim.rate: Expected a number >= 1.0",)),
    Mistake("launch kinematic --set services.robt_sim.rate=50", ("has no services.robt_sim. Did you mean 'robot_sim'?",)),
    Mistake("launch kinematic --duration ten", ("'ten' is not a positive number",)),
    Mistake("launch kinematic --ticks 10", ("a number of ticks is exact in lockstep only: set shared.mode=lock",)),
    Mistake("launch kinematic --endpoint 127.0.0.1:7447", ("write tcp/HOST:PORT", "such as tcp/127.0.0.1:7447")),
    Mistake("estop --endpoint tcp/127.0.0.1:74470", ("'tcp/127.0.0.1:74470' is no address of a router", "a port from 1 to 65535")),
    Mistake("status --endpoint tls/127.0.0.1", ("'tls/127.0.0.1' is no address of a router",)),
    Mistake("replay run --port 90910", ("'90910' is no port", "0 (a free port) to 65535")),
    Mistake(
        "launch kinematic --runs arm.urdf/runs --endpoint {endpoint}",
        ("cannot write arm.urdf/runs: Not a directory", "with --runs"),
        ENVIRONMENT,
    ),
    # places and runs
    Mistake("reach --offline --target -0.3 0.2", ("argument --target: expected 3 arguments",)),
    Mistake("reach --offline --target nan 0 0", ("position (nan, 0, 0) of the target: must be three finite numbers, in m",)),
    Mistake("reach --offline --target 0 0 0", ("(0, 0, 0) m is inside the robot's own root_link", "the nearest to which")),
    Mistake("reach --offline --target -3 2 1", ("The target is out of reach of right_arm", "with --target X Y Z"), 1),
    Mistake("reach --robot arm.urdf --target 1 0 0", ("--robot arm.urdf: only valid with --offline",)),
    Mistake("reach --offline --run run --target -0.3 0.2 0.1", ("no agent has learned to reach in this run yet",)),
    Mistake("plan --run nowhere --to 3", ("nowhere: there is no such file", "runs of `mobee launch` write such files")),
    Mistake("plan --run no_store --to 3", (f"no_store/{STORE}: there is no such file",)),
    Mistake("plan --run arm.urdf --to 3", ("arm.urdf: it is not a database; give another path",)),
    Mistake("plan --run run --to 81", ("torso has no such state. Valid are 0 to 26",)),
    Mistake("plan --run run --to 45 10 10", ("torso_yaw cannot be at 45 rad: valid is -0.873 to 0.873",)),
    Mistake("export no_store", ("no transitions are kept there",)),
    Mistake("roadmap query binary.npz --to 0 0", ("binary.npz: no roadmap, or only a part of one", "remove it and build it anew")),
    Mistake("roadmap query nofile.npz --to 0 0", ("there is no such file. `mobee roadmap build` makes maps",)),
    # no running system
    *(
        Mistake(f"{words} --endpoint {{endpoint}}", ("no router at {endpoint}", "Start it with `mobee launch`"), ENVIRONMENT)
        for words in ("status", "stop", "estop", "topic list", "topic echo clock", "reach --target -0.3 0.2 0.1")
    ),
    Mistake("conform {endpoint}", ("no router at {endpoint}",), ENVIRONMENT),
)


def answer(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """The exit code, and what stands on the terminal."""
    try:
        code = main(words)
    except SystemExit as ended:  # of argparse
        code = int(ended.code or 0)
    printed = capsys.readouterr()
    return code, " ".join(f"{printed.out} {printed.err}".split()) if code else ""


def check(mistake: Mistake, endpoint: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = [word.replace("{endpoint}", endpoint).replace("'", '"' if "=[" in word else "'") for word in mistake.words.split()]
    code, said = answer(words, capsys)
    for part in mistake.says:
        assert part.replace("{endpoint}", endpoint) in said
    assert code == mistake.code
    assert "Traceback" not in said
    if code != 1:
        assert len(said) < 1200 and said.startswith("mobee")


@pytest.fixture
def endpoint(free_port: int) -> str:
    return f"tcp/127.0.0.1:{free_port}"


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.words.replace(" ", "_"))
def test_a_mistake_is_answered_with_its_place_and_the_next_step(
    mistake: Mistake, folder: Path, endpoint: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "80")
    check(mistake, endpoint, capsys)


def test_forty_mistakes_are_enough() -> None:
    assert len(MISTAKES) >= 40


def test_a_port_in_use_is_named_with_a_free_one(endpoint: str, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        words = f"launch reach --set services.robot_sim.backend=kinematic --set services.monitor.web_port={port} --endpoint {endpoint}"
        code, said = answer(words.split(), capsys)
    assert code == ENVIRONMENT
    assert f"port {port} of monitor is in use: choose another with --set services.monitor.web_port=" in said and "--headless" in said


@pytest.mark.parametrize(
    ("package", "words", "says"),
    [
        ("rerun", "launch reach", 'monitor needs rerun, which is not installed: pip install "mobee[viz]"'),
    ],
)
def test_a_missing_extra_is_named_with_its_remedy(
    package: str, words: str, says: str, endpoint: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else find(name))
    code, said = answer([*words.split(), "--endpoint", endpoint], capsys)
    assert code == ENVIRONMENT and says in said


@pytest.fixture
def small_disk() -> Iterator[None]:
    """No file may grow beyond 512 bytes, as on a disk that is almost full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (512, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("words", ["convert {robot} full.urdf", "export {run} --csv full.csv"])
def test_a_full_disk_is_named_and_leaves_no_half_of_a_file(
    words: str, folder: Path, small_disk: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code, said = answer([word.format(robot=ROBOTS / "icub.xml", run=folder / "run") for word in words.split()], capsys)
    assert code in (1, ENVIRONMENT) and "cannot be written" in said and "full" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(shutil.which("bash") is None, reason="./launch is a script of bash")
def test_a_python_that_is_too_old_is_named(tmp_path: Path) -> None:
    for name in ("python3", "python3.11", "python3.12", "python3.13", "python3.14"):
        (tmp_path / name).write_text('#!/bin/sh\n[ "$1" = --version ] && echo "Python 3.9.2" && exit 0\nexit 1\n')
        (tmp_path / name).chmod(0o755)
    command = f"source {ROOT}/scripts/environment.sh; find_python"
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", command, "launch"], capture_output=True, text=True, env=environment)
    assert done.returncode == 1
    assert done.stderr == "launch: needs Python 3.11 to 3.14, found Python 3.9.2: install one of them with its venv module.\n"
