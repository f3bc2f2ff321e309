# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib.util
import re
import runpy
import sys
import warnings

import pytest

from tests.docker.compose_commands import COMPOSE, as_processes, compose_commands, load_compose

MODULES = sorted({command[2] for command in compose_commands().values() if command[0] == "python"})


def module_exists(name: str) -> bool:
    try:
        spec = importlib.util.find_spec(name)
    except ModuleNotFoundError:
        return False
    return spec is not None and (spec.submodule_search_locations is None or module_exists(f"{name}.__main__"))


def test_every_process_of_the_system_has_a_container() -> None:
    assert set(compose_commands()) == {
        "router",
        "robot_sim",
        "renderer",
        "model",
        "controller",
        "agent_torso",
        "agent_left_arm",
        "agent_right_arm",
        "vision",
        "monitor",
    }


def test_all_containers_run_one_image_built_here() -> None:
    services = load_compose()["services"].values()
    assert {service["image"] for service in services} == {"mobee"}
    for service in services:
        context = COMPOSE.parent / service["build"]["context"]
        assert (context / service["build"]["dockerfile"]).is_file()
        assert (context / "requirements.lock").is_file()


def test_every_service_waits_for_the_router_and_is_its_client() -> None:
    for name, service in load_compose()["services"].items():
        if name != "router":
            assert service["depends_on"] == ["router"]
            assert service["command"][3:5] == ["--endpoint", "tcp/router:7447"], name


def test_the_page_is_published_on_loopback_only() -> None:
    published = [port for service in load_compose()["services"].values() for port in service.get("ports", [])]
    assert published
    assert all(port.startswith("127.0.0.1:") for port in published)


def test_processes_of_this_machine_name_no_container() -> None:
    processes = as_processes(7999)
    assert next(iter(processes)) == "router"
    for argv in processes.values():
        assert "tcp/127.0.0.1:7999" in argv
        assert not re.search(r"router:|0\.0\.0\.0|7447", " ".join(argv))


@pytest.mark.parametrize("name", MODULES)
def test_the_module_of_a_command_can_be_run(name: str) -> None:
    assert module_exists(name)


def usage(program: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """What a program, `python -m MODULE ...`, prints with --help."""
    _, option, module, *arguments = program
    assert option == "-m"
    monkeypatch.setattr(sys, "argv", [module, *arguments, "--help"])
    with pytest.raises(SystemExit) as end, warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a module that another test has imported
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    assert end.value.code in (0, None)
    return capsys.readouterr().out


@pytest.mark.parametrize("name", compose_commands())
def test_a_command_uses_options_that_its_program_has(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = as_processes(7999)[name]
    first_option = next(i for i, word in enumerate(argv) if word.startswith("--"))
    known = usage(argv[:first_option], monkeypatch, capsys)
    for option in (word for word in argv if word.startswith("--")):
        assert re.search(rf"(?<![\w-]){option}(?![\w-])", known), option
