# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from bus_schema.messages import EStop
from services.common.exit_codes import ENVIRONMENT
from services.common.observe import Received, listen
from services.common.session import open_client
from services.launcher import run
from services.launcher.catalogue import entry_of
from services.launcher.connection import Connection, open_bus
from tests.services.launcher.launched import Launched, is_free, mobee, toys, wait_until

Launch = Callable[..., Launched]


@pytest.fixture
def endpoint(free_port: int) -> str:
    return f"tcp/127.0.0.1:{free_port}"


@pytest.fixture
def launch(tmp_path: Path, endpoint: str) -> Iterator[Launch]:
    started: list[Launched] = []

    def start(scenario: str, *options: str, at: str = endpoint) -> Launched:
        folder = tmp_path / f"launch{len(started)}"
        folder.mkdir()
        started.append(Launched(folder, at, scenario, *options))
        return started[-1]

    yield start
    for launched in started:
        launched.leave_nothing()


def test_a_timed_run_counts_from_readiness_and_leaves_nothing_behind(launch: Launch, free_port: int) -> None:
    launched = launch(toys(one="healthy", two="healthy"), "--duration", "0.5")
    code, summary = launched.end()
    assert code == 0
    assert summary["seconds_to_ready"] > 0
    assert summary["duration_s"] >= 0.5
    assert summary["restarts"] == {"one": 0, "two": 0}
    assert summary["services"]["one"]["marks"] == 1
    assert launched.children() == []
    assert is_free(free_port)


def test_the_run_folder_says_what_was_run(launch: Launch, endpoint: str) -> None:
    _, summary = launch(toys(one="healthy"), "--duration", "0.1", "--set", "services.one.seed=7").end()
    folder = Path(summary["run"])
    config = tomllib.loads((folder / "one.toml").read_text())
    assert config["seed"] == 7
    assert config["endpoint"] == endpoint
    assert config["run_dir"] == str(folder)
    assert tomllib.loads((folder / "scenario.toml").read_text())["services"]["one"] == {"module": "tests.services.toy_service", **config}
    assert "python" in tomllib.loads((folder / "versions.toml").read_text())
    assert folder.stat().st_mode & 0o077 == 0
    assert "ready as" in (folder / "logs" / "one.log").read_text()


def test_a_launch_that_cannot_write_leaves_no_session_open(tmp_path: Path, endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Connection] = []

    def open_noted(*given: Any) -> Connection:
        opened.append(open_bus(*given))
        return opened[-1]

    monkeypatch.setattr(run, "open_bus", open_noted)
    (tmp_path / "file").touch()
    (tmp_path / "toys.toml").write_text(toys(one="healthy"))
    options = run.Options(str(tmp_path / "toys.toml"), endpoint=endpoint, runs=tmp_path / "file" / "runs")
    assert run.launch(options) == ENVIRONMENT
    assert [bus.session.is_closed() for bus in opened] == [True]


def test_services_start_after_those_they_need_and_end_before_them(launch: Launch) -> None:
    launched = launch(toys(agent="healthy", controller="healthy", robot_sim="healthy", model="healthy"))
    launched.wait_for("all ready")
    ready = re.findall(r"(\w+) is ready", launched.news)
    assert set(ready[:2]) == {"robot_sim", "model"}
    assert ready[2:] == ["controller", "agent"]
    launched.process.send_signal(signal.SIGTERM)
    code, summary = launched.end()
    assert code == 0
    logs = {path.stem: path.read_text() for path in (Path(summary["run"]) / "logs").iterdir()}
    over = {who: float(found[1]) for who, text in logs.items() if (found := re.search(r"over at ([\d.]+)", text))}
    assert sorted(over, key=lambda who: over[who]) == ["agent", "controller", "model", "robot_sim"]


def test_a_service_that_crashes_is_restarted_after_a_doubling_pause(launch: Launch) -> None:
    launched = launch(toys(one="crash_once_ready", two="healthy"))
    launched.wait_for("starts again in 0.2 s")
    wait_until(lambda: launched.news.count("one is ready") > 2, 20)
    launched.process.send_signal(signal.SIGTERM)
    code, summary = launched.end()
    assert code == 0
    assert summary["restarts"]["one"] >= 2
    assert summary["restarts"]["two"] == 0
    assert re.findall(r"the motor burnt; starts again (at once|in [\d.]+ s)", launched.news)[:2] == ["at once", "in 0.2 s"]


def test_a_service_that_keeps_failing_is_given_up_and_the_robot_stopped(launch: Launch, endpoint: str) -> None:
    launched = launch(toys(one="crash_at_start", two="healthy"))
    launched.wait_for("starts again at once")
    stops: list[Received] = []
    with open_client(endpoint) as session:
        listen(session, EStop.stream.key(), stops.append)
        code, summary = launched.end(120)
        wait_until(lambda: bool(stops), 10)
    assert code == 1
    waits = re.findall(r"starts again (?:at once|in ([\d.]+) s)", launched.news)
    assert waits == ["", "0.2", "0.4", "0.8", "1.6"]
    assert summary["restarts"]["one"] == 5
    assert ["no hardware at all" in fault for fault in summary["faults"]] == [True]
    assert {stop.content()["set"] for stop in stops} == {True}  # repeated, since no robot_sim confirms it
    assert launched.children() == []


def test_a_service_that_cannot_use_its_settings_is_not_started_again(launch: Launch) -> None:
    launched = launch(toys(one="bad_settings"))
    code, summary = launched.end()
    assert code == 2
    assert summary["restarts"]["one"] == 0
    assert "unknown field 'colour'" in summary["faults"][0]


def test_a_frozen_service_is_killed_and_restarted(launch: Launch) -> None:
    launched = launch(toys(one="freeze", two="healthy"))
    launched.wait_for("all ready")
    frozen = re.search(r"one is ready .*pid (\d+)", launched.news)
    launched.wait_for("one is frozen")
    assert frozen and not psutil.pid_exists(int(frozen[1]))
    wait_until(lambda: launched.news.count("one is ready") == 2, 20)
    launched.process.send_signal(signal.SIGTERM)
    code, summary = launched.end()
    assert code == 0
    assert summary["restarts"] == {"one": 1, "two": 0}


def test_a_service_whose_handler_hangs_is_frozen(launch: Launch) -> None:
    launched = launch(toys(one="hang"))
    launched.wait_for("one is frozen")


@pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="only Linux reports how long a process waits for a processor")
def test_a_slow_service_is_not_frozen(launch: Launch) -> None:
    launched = launch(toys(backlog="backlog", starve="starve"), "--duration", "6.5")
    code, summary = launched.end()
    assert code == 0
    assert summary["restarts"] == {"backlog": 0, "starve": 0}, launched.news


@pytest.mark.parametrize(("number", "name"), [(signal.SIGKILL, "SIGKILL"), (signal.SIGRTMIN + 3, f"signal {signal.SIGRTMIN + 3:d}")])
def test_a_service_that_is_killed_is_back_within_seconds(launch: Launch, number: int, name: str) -> None:
    launched = launch(toys(one="healthy"))
    launched.wait_for("all ready")
    launched.children()[0].send_signal(number)
    launched.wait_for(f"one was killed by {name}")
    wait_until(lambda: launched.news.count("one is ready") == 2, 20)
    assert launched.news.count("one is ready") == 2


def test_a_service_that_has_done_its_work_is_left_in_peace(launch: Launch) -> None:
    launched = launch(toys(one="finish", two="healthy"))
    launched.wait_for("one has ended")
    launched.wait_for("all ready")
    launched.process.send_signal(signal.SIGTERM)
    code, summary = launched.end()
    assert code == 0
    assert summary["restarts"]["one"] == 0


def test_an_agent_may_end_when_it_has_made_its_transitions_and_a_service_of_the_robot_may_not() -> None:
    may_end = {who: entry.may_end for who in ("robot_sim", "model", "controller", "agent_torso") if (entry := entry_of(who, None))}
    assert may_end == {"robot_sim": False, "model": False, "controller": False, "agent_torso": True}


def test_a_service_of_the_robot_that_ends_unasked_has_failed(launch: Launch) -> None:
    launched = launch(toys(controller="finish"))
    launched.wait_for("controller ended, and the launcher had not asked for it; starts again in 0.2 s")
    launched.process.send_signal(signal.SIGTERM)
    code, summary = launched.end()
    assert code == 0
    assert summary["restarts"]["controller"] >= 1


def test_the_launcher_survives_that_a_service_cannot_be_started(launch: Launch) -> None:
    """The folder of the run, in which the service has its log, is gone."""
    launched = launch(toys(one="healthy", two="healthy"))
    launched.wait_for("all ready")
    shutil.rmtree(next((launched.folder / "runs").iterdir()))
    launched.children()[0].kill()
    launched.wait_for("cannot be started: [Errno 2] No such file or directory")
    launched.process.send_signal(signal.SIGTERM)
    code, summary = launched.end()
    assert code in (0, 1)
    assert sum(summary["restarts"].values()) >= 0
    assert launched.children() == []


def test_ctrl_c_once_stops_everything(launch: Launch, free_port: int) -> None:
    launched = launch(toys(one="healthy", two="healthy"))
    launched.wait_for("all ready")
    assert len(launched.children()) == 2
    launched.process.send_signal(signal.SIGINT)
    assert launched.end()[0] == 0
    assert launched.children() == []
    assert is_free(free_port)


def test_ctrl_c_during_the_start_stops_everything(launch: Launch) -> None:
    launched = launch(toys(one="crash_at_start", two="healthy"))
    launched.wait_for("starts again")
    launched.process.send_signal(signal.SIGINT)
    assert launched.end()[0] == 0
    assert launched.children() == []


def test_a_service_deaf_to_sigterm_is_killed_after_two_seconds(launch: Launch) -> None:
    launched = launch(toys(one="deaf"), "--duration", "0.1")
    assert launched.end()[0] == 0
    assert "one did not end within 2 s: killed" in launched.news
    assert launched.children() == []


def test_ctrl_c_twice_kills(launch: Launch, free_port: int) -> None:
    launched = launch(toys(one="deaf"))
    launched.wait_for("all ready")
    launched.process.send_signal(signal.SIGINT)
    launched.wait_for("stopping")
    launched.process.send_signal(signal.SIGINT)
    assert launched.end()[0] == 1
    assert "did not end within" not in launched.news  # it was not waited for
    assert launched.children() == []
    assert is_free(free_port)


def test_services_of_a_killed_launcher_end_when_the_next_one_comes(launch: Launch) -> None:
    orphaned = launch(toys(one="healthy", two="healthy"))
    orphaned.wait_for("all ready")
    orphans = orphaned.children()
    orphaned.process.kill()
    orphaned.process.wait()
    launched = launch(toys(one="healthy"))
    launched.wait_for("all ready")
    psutil.wait_procs(orphans, timeout=20)
    assert [process for process in orphans if process.is_running()] == []
    assert len(launched.children()) == 1


def test_a_second_launcher_at_the_same_endpoint_describes_the_first_in_one_line(launch: Launch, endpoint: str) -> None:
    first = launch(toys(one="healthy"))
    first.wait_for("all ready")
    second = launch(toys(one="healthy"))
    assert second.end() == (3, {})
    assert len(second.news.splitlines()) == 1
    assert f"a system runs already at {endpoint}, since " in second.news
    assert f"launcher {first.process.pid}): toys: 1 of 1 ready, {first.folder}/runs/" in second.news
    assert f"End it with `mobee stop --endpoint {endpoint}`, or start this one beside it with --endpoint tcp/127.0.0.1:" in second.news
    assert not (second.folder / "runs").exists()


def test_an_endpoint_of_another_program_is_refused_in_one_line(launch: Launch, endpoint: str) -> None:
    with socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2]))):
        launched = launch(toys(one="healthy"))
        assert launched.end() == (3, {})
    assert len(launched.news.splitlines()) == 1
    assert f"cannot listen at {endpoint}" in launched.news


def test_a_unix_socket_is_gone_after_the_run(launch: Launch, tmp_path: Path) -> None:
    socket = tmp_path / "bus.sock"
    launched = launch(toys(one="healthy"), at=f"unixsock-stream/{socket}")
    launched.wait_for("all ready")
    assert socket.exists()
    launched.process.send_signal(signal.SIGINT)
    assert launched.end()[0] == 0
    assert list(tmp_path.glob("*.sock*")) == []


def test_a_runs_folder_that_cannot_be_written_is_refused_in_one_line(tmp_path: Path, endpoint: str) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "toys.toml").write_text(toys(one="healthy"))
    done = mobee("launch", str(tmp_path / "toys.toml"), "--endpoint", endpoint, "--runs", str(tmp_path / "file" / "runs"))
    assert done.returncode == 3
    assert len(done.stderr.splitlines()) == 1
    assert str(tmp_path / "file") in done.stderr


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (("--endpoint", "tcp/0.0.0.0:{port}"), 2, "other hosts can reach tcp/0.0.0.0:{port}: launch with --secure, "),
        (("--secure", "--keys", "{folder}/none"), 3, "{folder}/none: No such file or directory; `mobee keys new` makes a folder of keys"),
        (("--secure", "--keys", "{folder}"), 3, "is missing: {folder} is no folder of keys"),
        (("--keys", "{folder}"), 2, "--keys is for --secure"),
        (("--secure", "--insecure"), 2, "contradict each other"),
    ],
)
def test_a_launch_without_the_keys_that_it_needs_is_refused_in_one_line(
    tmp_path: Path, free_port: int, options: tuple[str, ...], code: int, said: str
) -> None:
    tmp_path.chmod(0o700)
    (tmp_path / "toys.toml").write_text(toys(one="healthy"))
    given = [option.format(folder=tmp_path, port=free_port) for option in options]
    done = mobee("launch", str(tmp_path / "toys.toml"), "--runs", str(tmp_path / "runs"), *given)
    assert done.returncode == code, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert said.format(folder=tmp_path, port=free_port) in done.stderr
    assert not (tmp_path / "runs").exists()


def test_an_insecure_launch_for_other_hosts_warns_and_starts(launch: Launch, free_port: int) -> None:
    launched = launch(toys(one="healthy"), "--insecure", "--duration", "0.1", at=f"tcp/0.0.0.0:{free_port}")
    assert launched.end()[0] == 0
    assert launched.news.splitlines()[0] == f"mobee launch: every program that reaches tcp/0.0.0.0:{free_port} can move the robot"


def test_a_secured_launch_names_the_service_that_has_no_keys(tmp_path: Path, endpoint: str) -> None:
    from services.common.certificates import KeyFolder

    KeyFolder.new(tmp_path / "keys", [("router", None), ("launcher", "launcher")])
    (tmp_path / "toys.toml").write_text(toys(one="healthy"))
    done = mobee("launch", str(tmp_path / "toys.toml"), "--endpoint", endpoint, "--secure", "--keys", str(tmp_path / "keys"))
    assert done.returncode == 3
    assert "one.crt is missing, so that nothing can connect as one: make it with `mobee keys add one --keys" in done.stderr


def test_services_of_a_launch_do_not_inherit_the_keys_of_its_user(launch: Launch, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MOBEE_KEYS", str(tmp_path))
    launched = launch(toys(one="healthy"), "--duration", "0.1")
    assert launched.end()[0] == 0
