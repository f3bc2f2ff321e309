# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib.util
import re
import socket
import sys
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.robot import load
from services.common.config import ConfigError
from services.launcher.checks import MissingExtra, PortInUse, check_extras, check_gains, check_ports, check_robots, check_services
from services.launcher.run import Options, _read
from services.launcher.run_directory import make_run_directory, to_toml
from services.launcher.scenario import read_scenario, shipped
from tests.services.launcher.launched import mobee, toys
from tests.services.robots import ARM, chain, seer

SCENARIO = """\
title = "a test"

[shared]
gains = "default"

[services.robot_sim]
backend = "kinematic"

[services.model]
world = "table"
gains = "published_2014"

[services.agent_torso]
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO)
    return path


def mistake(path: Path | str, *settings: str) -> str:
    with pytest.raises(ConfigError) as caught:
        check_robots(read_scenario(str(path), settings))
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", shipped())
def test_shipped_scenarios_are_right(name: str) -> None:
    scenario = read_scenario(name)
    check_services(scenario, check_robots(scenario))
    assert scenario.title


def test_model_and_controller_must_use_one_set_of_gains_and_terms() -> None:
    check_gains(read_scenario("default", ["shared.gains=default"]))
    with pytest.raises(ConfigError, match="model default, controller published_2014"):
        check_gains(read_scenario("default", ["services.model.gains=default"]))
    check_gains(read_scenario("default", ['shared.terms=["my_forces:viscous"]']))
    with pytest.raises(ConfigError, match="terms differ: model .*set terms once, as shared.terms"):
        check_gains(read_scenario("default", ['services.controller.terms=["my_forces:viscous"]']))


def test_services_that_are_added_have_the_robot_of_the_simulator(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('[services.robot_sim]\nrobot = "katana"\n')
    scenario = read_scenario(str(path), with_also=["monitor"], record=True)
    assert {part.who: part.config.robot for part in scenario.parts} == dict.fromkeys(("recorder", "robot_sim", "monitor"), "katana")
    scenario = read_scenario(str(path), ["services.robot_sim.robot=icub_2014", "services.monitor.robot=icub"], [], ["monitor"], record=True)
    assert [part.config.robot for part in scenario.parts] == ["icub_2014", "icub_2014", "icub"]


def test_all_services_must_have_one_robot(tmp_path: Path) -> None:
    (tmp_path / "copy.xml").write_text((Path(load.__file__).parent / "robots" / "katana.xml").read_text())
    with pytest.raises(ConfigError, match=r"robots differ: robot_sim katana, model icub, .*set it as shared.robot"):
        check_robots(read_scenario("reach", ["services.robot_sim.robot=katana"], leave_out=["vision", "renderer", "monitor"]))
    path = tmp_path / "two.toml"
    path.write_text('[services.robot_sim]\nrobot = "katana"\n[services.model]\nrobot = "copy.xml"\n')
    assert len(check_robots(read_scenario(str(path)))) == 2  # one robot by two names


def test_parts_come_in_the_order_of_their_start() -> None:
    names = [part.who for part in read_scenario("default").parts]
    assert names == [
        "robot_sim",
        "model",
        "controller",
        "agent_torso",
        "agent_left_arm",
        "agent_right_arm",
        "renderer",
        "vision",
        "monitor",
    ]


def test_an_agent_gets_its_part_and_services_get_their_shared_settings(scenario: Path) -> None:
    parts = {part.who: part.config for part in read_scenario(str(scenario)).parts}
    assert parts["agent_torso"].part == "torso"
    assert parts["model"].gains == "published_2014"
    assert not hasattr(parts["robot_sim"], "gains")


def test_a_robot_of_ones_own_has_no_table_and_the_run_s_record_shows_it(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    path = tmp_path / "arm.toml"
    path.write_text(f'[shared]\nrobot = "{tmp_path}/arm.xml"\n[services.robot_sim]\nbackend = "kinematic"\n[services.model]\n')
    scenario = read_scenario(str(path))
    assert {part.who: part.config.world for part in scenario.parts} == {"robot_sim": "none", "model": "none"}
    check_robots(scenario)
    run = make_run_directory(tmp_path / "runs", scenario, "tcp/127.0.0.1:1")
    assert tomllib.loads((run / "model.toml").read_text())["world"] == "none"
    empty = read_scenario("kinematic", ["shared.world=none"])
    assert {part.config.world for part in empty.parts if hasattr(part.config, "world")} == {"none"}
    assert {part.config.world for part in read_scenario(str(path), ["shared.robot=icub"]).parts} == {"table"}


def test_files_are_found_beside_the_scenario_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    (tmp_path / "learned.sqlite").touch()
    path = tmp_path / "arm.toml"
    agent = '[services.agent_arm]\ncontinues = "learned.sqlite"\n'
    path.write_text(f'[shared]\nrobot = "arm.xml"\n[services.robot_sim]\nbackend = "kinematic"\n{agent}')
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    configs = {part.who: part.config for part in read_scenario(str(path)).parts}
    assert configs["robot_sim"].robot == str(tmp_path / "arm.xml")
    assert getattr(configs["agent_arm"], "continues", "") == str(tmp_path / "learned.sqlite")


def test_the_run_s_record_names_files_so_that_they_are_found_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm.xml").write_text(ARM)
    Path("arm.toml").write_text('[services.model]\nrobot = "arm.xml"\nworld = "table"\n')
    run = make_run_directory(tmp_path / "runs", read_scenario("arm.toml"), "tcp/127.0.0.1:1")
    written = tomllib.loads((run / "model.toml").read_text())
    assert (written["robot"], written["world"]) == (str(tmp_path / "arm.xml"), "table")


@pytest.mark.parametrize(
    ("endpoint", "routes", "address"),
    [
        ("tcp/192.168.1.5:7447", True, "192.168.1.5:7447"),
        ("tcp/192.168.1.5:7447", False, ""),
        ("tls/192.168.1.5:7447", True, ""),
    ],
)
def test_robot_sim_receives_datagrams_on_the_router_s_host_only(
    tmp_path: Path, scenario: Path, endpoint: str, routes: bool, address: str
) -> None:
    run = make_run_directory(tmp_path / "runs", read_scenario(str(scenario)), endpoint, routes)
    assert tomllib.loads((run / "robot_sim.toml").read_text())["stop_address"] == address


def test_settings_of_the_command_line_win(scenario: Path) -> None:
    parts = {part.who: part.config for part in read_scenario(str(scenario), ["services.model.contact_forces=false", "shared.seed=5"]).parts}
    assert parts["model"].contact_forces is False
    assert {config.seed for config in parts.values()} == {5}


@pytest.mark.parametrize(
    ("line", "typo", "where", "said"),
    [
        ("title =", "titel =", ":1:", "Did you mean 'title'?"),
        ("[services.model]", "[services.modle]", ":9:", "Did you mean 'model'?"),
        ("[shared]", "[shard]", ":3:", "Did you mean 'shared'?"),
        ("world =", "wrld =", ":10:", "Did you mean 'world'?"),
        ('"published_2014"', '"published_2041"', ":11:", "Did you mean 'published_2014'?"),
        ('"default"', '"defualt"', ":4:", "Did you mean 'default'?"),
        ('gains = "default"', 'gain = "default"', ":4:", "Did you mean 'gains'?"),
        ('"kinematic"', '"kinematics"', ":7:", "Did you mean 'kinematic'?"),
        ('"table"', '"tabel"', ":10:", "Did you mean 'table'?"),
        ("agent_torso", "agent_torsoe", ":13:", "Did you mean 'torso'?"),
        ('world = "table"', "world = 3", ":10:", 'Expected a text in "quotes", got a whole number'),
    ],
)
def test_a_typo_names_file_line_and_the_nearest_valid_name(scenario: Path, line: str, typo: str, where: str, said: str) -> None:
    text = SCENARIO.replace(line, typo, 1)
    if typo == '"defualt"':
        text = text.replace('gains = "published_2014"\n', "")
    scenario.write_text(text)
    text = mistake(scenario)
    assert text.startswith(f"{scenario}{where}")
    assert said in text


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("services.model.contact_force=false", "Did you mean 'contact_forces'?"),
        ("services.modle.contact_forces=false", "Did you mean 'model'?"),
        ("service.model.contact_forces=false", "Did you mean 'services'?"),
        ("services.model.contact_forces=maybe", "Expected true or false, got a text"),
        ("contact_forces=false", "table.field=value"),
        ("services.model.contact_forces", "table.field=value"),
    ],
)
def test_a_mistaken_setting_is_named(scenario: Path, setting: str, said: str) -> None:
    text = mistake(scenario, setting)
    assert text.startswith(f"--set {setting}")
    assert said in text


@pytest.mark.parametrize(
    ("right", "typo", "said"),
    [
        ("<box ", "<bax ", "<bax>: unknown tag is ignored. Did you mean 'box'?"),
        ("role=", "rol=", "<sphere>: unknown attribute 'rol' is ignored. Did you mean 'role'?"),
    ],
)
def test_a_typo_in_a_world_that_a_library_would_ignore_is_refused(tmp_path: Path, right: str, typo: str, said: str) -> None:
    lines = (Path(load.__file__).parent / "worlds" / "table.xml").read_text().splitlines()
    number = next(number for number, line in enumerate(lines, 1) if right in line)
    lines[number - 1] = lines[number - 1].replace(right, typo)
    world = tmp_path / "mine.xml"
    world.write_text("\n".join(lines))
    assert mistake("default", f"shared.world={world}").startswith(f"{world}:{number}: {said}")


def unable(folder: Path, robot: str, services: str, suffix: str = "xml") -> str:
    """What is said of a scenario whose robot one of its services cannot serve."""
    (folder / f"own.{suffix}").write_text(robot)
    path = folder / "own.toml"
    path.write_text(f'[shared]\nrobot = "{folder}/own.{suffix}"\n{services}')
    scenario = read_scenario(str(path))
    with pytest.raises(ConfigError) as caught:
        check_services(scenario, check_robots(scenario))
    assert "\n" not in str(caught.value)
    place, _, text = str(caught.value).partition(": ")
    assert re.fullmatch(rf"{path}:[36]", place)  # the service's table, or the setting that the message quotes
    return text


NO_EYES = '<marker name="left_eye" nx="-1"/>'


@pytest.mark.parametrize(
    ("robot", "services", "says", "instead"),
    [
        (ARM, "[services.renderer]\n", "renderer: 'arm' cannot see: 1 camera is needed, and it has none", "or --camera LINK"),
        (seer(eyes=NO_EYES), "[services.vision]\n", "vision: 'seer' cannot see: 2 cameras are needed", "add right_eye to the robot's file"),
        (ARM, '[services.vision]\ncameras = ["tip"]\n', "vision: 'arm' cannot see: 2 cameras are needed", "it has tip"),
        (ARM, '[services.renderer]\ncameras = ["top"]\n', "renderer: unknown link or marker 'top'", "tip"),
        (
            ARM,
            '[services.robot_sim]\nbackend = "pybullet"\n',
            "robot_sim: backend = \"pybullet\" cannot move 'arm'",
            'Set backend = "mujoco"',
        ),
        (ARM, '[services.agent_arm]\njoints = ["pan"]\nneighbours = 5\n', "agent_arm: neighbours", "2"),
        (
            ARM,
            "[services.agent_arm]\nneighbours = 8\ntargets = [[0, 0, 0]]\nmarker = 'palm'",
            "agent_arm: arm does not move",
            "Valid: tip.",
        ),
        (ARM, "[services.controller]\nposture = { arm = [0.0] }\n", "controller: posture of arm: 1 numbers", "it has 2 motors"),
        (ARM.replace('bodypart name="arm"', 'bodypart name="Arm"'), "[services.model]\n", "model: part 'Arm' of 'arm'", "rename the part"),
    ],
)
def test_a_service_that_cannot_serve_the_robot_is_refused_before_the_start(
    tmp_path: Path, robot: str, services: str, says: str, instead: str
) -> None:
    text = unable(tmp_path, robot, services)
    assert text.startswith(says)
    assert instead in text


def test_a_state_space_that_is_too_large_is_refused_with_joints_to_take(tmp_path: Path) -> None:
    text = unable(tmp_path, chain(11), "[services.agent_all]\n", "urdf")
    assert text.startswith("agent_all: 3 levels of 11 motors make 1.77e+05 states")
    assert 'joints = ["joint_0", "joint_1", "joint_2", "joint_3"]' in text


def test_a_robot_with_eyes_is_served_by_every_service(tmp_path: Path) -> None:
    (tmp_path / "seer.xml").write_text(seer())
    path = tmp_path / "seer.toml"
    names = ("model", "controller", "renderer", "vision", "monitor", "port_filter")
    tables = "".join(f"[services.{name}]\n" for name in names)
    text = f'[shared]\nrobot = "{tmp_path}/seer.xml"\nworld = "table"\n[services.robot_sim]\nbackend = "kinematic"\n{tables}'
    path.write_text(text)
    scenario = read_scenario(str(path))
    check_services(scenario, check_robots(scenario))
    path.write_text(text.replace('world = "table"', 'world = "none"'))
    scenario = read_scenario(str(path))
    with pytest.raises(ConfigError, match="vision has nothing to look for: .* or leave the service out"):
        check_services(scenario, check_robots(scenario))


def test_the_command_ends_with_two_and_one_line_when_a_service_cannot_serve_the_robot(tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text(ARM)
    done = mobee("launch", "kinematic", "--set", f"shared.robot={tmp_path}/own.xml")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    (tmp_path / "own.toml").write_text(f'[services.robot_sim]\nrobot = "{tmp_path}/own.xml"\nbackend = "pybullet"\n')
    done = mobee("launch", str(tmp_path / "own.toml"), "--runs", str(tmp_path / "runs"))
    assert (done.returncode, done.stderr.count("\n"), (tmp_path / "runs").exists()) == (2, 1, False)
    assert 'Set backend = "mujoco"' in done.stderr


def test_an_unknown_scenario_names_the_nearest() -> None:
    assert "Did you mean 'kinematic'?" in mistake("kinematick")


@pytest.mark.parametrize("content", [b"title = ", b"\xff\xfe", b"", b"services = 3"])
def test_what_is_no_scenario_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    assert mistake(path).startswith(str(path))


def test_a_mistake_ends_the_command_with_two(scenario: Path) -> None:
    scenario.write_text(SCENARIO.replace("world =", "wrld ="))
    done = mobee("launch", str(scenario))
    assert done.returncode == 2
    assert done.stderr.startswith(f"mobee launch: {scenario}:10: unknown field 'services.model.wrld'.")
    assert len(done.stderr.splitlines()) == 1


def missing(monkeypatch: pytest.MonkeyPatch, package: str, *settings: str) -> str:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else find(name))
    with pytest.raises(MissingExtra) as caught:
        check_extras(read_scenario("default", settings))
    return str(caught.value)


@pytest.mark.parametrize(
    ("package", "service", "remedy"),
    [
        ("icub_models", "robot_sim", "mobee[sim]"),
        ("pybullet", "robot_sim", "mobee[sim]"),
        ("rerun", "monitor", "mobee[viz]"),
    ],
)
def test_a_missing_extra_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch, package: str, service: str, remedy: str) -> None:
    text = missing(monkeypatch, package, "services.robot_sim.backend=pybullet")
    assert text.startswith(f"{service} needs {package}")
    assert f'pip install "{remedy}"' in text


def test_where_pybullet_has_no_wheel_mujoco_is_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 14, 0))
    assert 'set backend = "mujoco"' in missing(monkeypatch, "pybullet", "services.robot_sim.backend=pybullet")


def test_a_page_can_be_added_to_a_scenario_without_one() -> None:
    assert "monitor" not in [part.who for part in read_scenario("kinematic").parts]
    added = read_scenario("kinematic", ["services.monitor.web_port=9123"], with_also=["monitor"])
    assert [part.config.web_port for part in added.parts if part.who == "monitor"] == [9123]
    assert [part.who for part in read_scenario("reach", with_also=["monitor"]).parts].count("monitor") == 1


@pytest.mark.parametrize("settings", [(), ("services.robot_sim.backend=auto",)])
def test_a_robot_without_physics_needs_no_extra(monkeypatch: pytest.MonkeyPatch, settings: tuple[str, ...]) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    check_extras(read_scenario("kinematic", settings))


def test_a_port_in_use_is_named_with_its_remedy() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        setting = f"services.monitor.web_port={taken.getsockname()[1]}"
        with pytest.raises(PortInUse, match="--set services.monitor.web_port="):
            check_ports(read_scenario("default", [setting]))
        check_ports(read_scenario("default", [setting], leave_out=["monitor"]))


@pytest.mark.parametrize(
    ("module", "said"),
    [
        ("''", "module '' is no name of a module"),
        ("'..up'", "module '..up' is no name of a module"),
        ("3", "module 3 is no name of a module"),
        ("'none_of_that_name'", "cannot import Config from none_of_that_name.config (ModuleNotFoundError"),
        ("'half_written'", "cannot import Config from half_written.config (SyntaxError"),
    ],
)
def test_a_program_that_cannot_be_used_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, said: str
) -> None:
    (tmp_path / "half_written").mkdir()
    (tmp_path / "half_written" / "config.py").write_text("class Config(")
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "own.toml"
    path.write_text(f"[services.own]\nmodule = {module}\n")
    with pytest.raises(ConfigError, match=re.escape(said)) as refused:
        read_scenario(str(path))
    assert str(refused.value).startswith(f"{path}:")


def test_another_program_may_take_the_place_of_a_service(tmp_path: Path) -> None:
    path = tmp_path / "toys.toml"
    path.write_text(toys(controller="healthy", own="healthy"))
    entries = {part.who: part.entry for part in read_scenario(str(path)).parts}
    assert entries["controller"].module == "tests.services.toy_service"
    assert entries["controller"].after == ("robot_sim", "model")
    assert entries["own"].after == ("controller",)


_KEYS = st.text(min_size=1, max_size=10)
_VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=5,
)


@given(st.dictionaries(_KEYS, _VALUES | st.dictionaries(_KEYS, _VALUES, max_size=3), max_size=5))
def test_settings_survive_as_toml(tables: dict[str, object]) -> None:
    assert tomllib.loads(to_toml(tables)) == tables


OLD_ROBOT = """<ZeroPositionKinematicTree version="1.0" robotName="old">
 <bodypart name="torso"><motor name="pan" minPos="-90" maxPos="90"><joint z="1" name="pan">
  <link x="0.2"><sphere radius="0.05"/>{0}</link>
 </joint></motor></bodypart>
</ZeroPositionKinematicTree>
"""


@pytest.mark.filterwarnings("ignore::mobee.errors.OlderVersion")
def test_a_robot_of_an_older_version_may_start_and_one_with_a_slip_may_not(tmp_path: Path) -> None:
    robot, path = tmp_path / "old.xml", tmp_path / "old.toml"
    path.write_text(f'title = "old"\n[shared]\nrobot = "{robot}"\n[services.robot_sim]\nbackend = "kinematic"\n')
    robot.write_text(OLD_ROBOT.format(""))
    (loaded,) = check_robots(read_scenario(str(path))).values()
    assert loaded.name == "old"
    robot.write_text(OLD_ROBOT.format("<shpere/>"))
    with pytest.raises(ConfigError, match=r"old.xml:3: <shpere>: unknown tag .* The launcher ignores nothing"):
        check_robots(read_scenario(str(path)))


def test_a_camera_on_a_link_brings_the_renderer_and_is_known_to_all_that_use_pictures() -> None:
    scenario = _read(Options("kinematic", page=True, cameras=("right_palm",)))
    seeing = {part.who: part.config.cameras for part in scenario.parts if "cameras" in part.config.__struct_fields__}
    assert seeing == {"renderer": ("right_palm",), "monitor": ("right_palm",)}
    with pytest.raises(ConfigError, match="--camera: pictures depend on real time"):
        _read(Options("lockstep", cameras=("right_palm",)))
