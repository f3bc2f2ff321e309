# SPDX-License-Identifier: Apache-2.0
"""The verbs of an operator against a system of toys that runs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.common.certificates import KeyFolder
from tests.services.launcher.launched import Launched, is_free, mobee, toys, wait_until


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    port = next(port for port in range(27447, 27547) if is_free(port))
    launched = Launched(tmp_path_factory.mktemp("verbs"), f"tcp/127.0.0.1:{port}", toys(agent_toy="talk", two="healthy"))
    launched.wait_for("all ready")
    yield launched
    launched.leave_nothing()


def test_status_shows_every_service(running: Launched) -> None:
    done = mobee("status", "--endpoint", running.endpoint)
    assert done.returncode == 0
    services, *others = done.stdout.split("\n\n")
    health = next(block for block in others if block.startswith("process"))
    rows = {line.split()[0]: line.split()[1] for line in services.splitlines()}
    assert {line.split()[0] for line in health.splitlines()[1:]} == {"launcher", "agent_toy", "two"}
    assert rows["launcher"] == rows["agent_toy"] == rows["two"] == "ready"
    assert max(map(len, [*services.splitlines(), *health.splitlines()])) <= 80


def test_doctor_describes_the_running_system(running: Launched) -> None:
    found = {one["subject"]: one for one in json.loads(mobee("doctor", "--json", "--endpoint", running.endpoint).stdout)}
    assert f"one runs at {running.endpoint} since 0 min (launcher {running.process.pid}): toys: 2 of 2 ready" in found["systems"]["found"]
    assert found["systems"]["remedy"] == f"`mobee stop --endpoint {running.endpoint}` ends it"


def test_status_as_json(running: Launched) -> None:
    status = json.loads(mobee("status", "--json", "--endpoint", running.endpoint).stdout)
    assert status["services"]["two"]["state"] == "ready"
    assert status["services"]["two"]["restarts"] == 0
    agent = status["agents"]["toy"]
    assert (agent["transitions"], type(agent["transitions"])) == (7, int)
    assert agent["action_time_mean"] is None


def test_status_fails_while_a_service_is_down(running: Launched) -> None:
    two = next(process for process in running.children() if any(word.endswith("two.toml") for word in process.cmdline()))
    two.kill()
    running.wait_for("two was killed")
    done = mobee("status", "--json", "--endpoint", running.endpoint)
    status = json.loads(done.stdout)
    restarted = status["services"]["two"]
    assert (done.returncode, restarted["state"]) == (1, "down") or restarted["restarts"] == 1  # it is back within half a second
    wait_until(lambda: running.news.count("two is ready") == 2, 5)
    assert mobee("status", "--endpoint", running.endpoint).returncode == 0


def test_topic_list_finds_the_published_messages(running: Launched) -> None:
    topics = json.loads(mobee("topic", "list", "--json", "--endpoint", running.endpoint).stdout)
    event = next(topic for topic in topics if topic["key"] == "event/agent_toy")
    assert event["type"] == "Event"
    assert event["rate_hz"] > 0
    table = mobee("topic", "list", "--endpoint", running.endpoint).stdout
    assert "event/agent_toy" in table
    assert max(map(len, table.splitlines())) <= 80


def test_topic_echo_prints_a_line_of_json_a_message(running: Launched) -> None:
    done = mobee("topic", "echo", "event/*", "--count", "3", "--endpoint", running.endpoint)
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(messages) == 3
    assert {message["type"] for message in messages} == {"Event"}
    assert messages[0]["message"]["code"] == "hello"
    assert messages[1]["message"]["seq"] == messages[0]["message"]["seq"] + 1


def test_topic_echo_says_when_nothing_comes(running: Launched) -> None:
    done = mobee("topic", "echo", "clock", "--duration", "1.3", "--endpoint", running.endpoint)
    assert done.returncode == 0
    assert "nothing on 'clock' yet" in done.stderr


def test_topic_hz_measures_the_period(running: Launched) -> None:
    done = mobee("topic", "hz", "event/agent_toy", "--duration", "1", "--json", "--endpoint", running.endpoint)
    figures = json.loads(done.stdout)
    assert figures["rate_hz"] == pytest.approx(1 / figures["period_s"])
    assert figures["period_s"] > 0.05  # the toy says it every 0.1 s
    assert figures["shortest_s"] <= figures["period_s"] <= figures["longest_s"]


def test_topic_hz_fails_when_nothing_comes(running: Launched) -> None:
    done = mobee("topic", "hz", "clock", "--duration", "0.2", "--endpoint", running.endpoint)
    assert (done.returncode, done.stdout.strip()) == (1, "no messages")


def test_a_key_that_cannot_be_is_refused(running: Launched) -> None:
    done = mobee("topic", "echo", "a//b", "--endpoint", running.endpoint)
    assert done.returncode == 2
    assert "a//b" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_reader_that_has_seen_enough_is_no_error(running: Launched) -> None:
    argv = [sys.executable, "-m", "mobee_cli", "topic", "echo", "event/*", "--endpoint", running.endpoint]
    echo = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert echo.stdout and echo.stderr
    echo.stdout.readline()
    echo.stdout.close()
    assert echo.wait(timeout=60) == 0
    assert echo.stderr.read() == ""


def test_estop_without_a_robot_does_not_pretend(running: Launched) -> None:
    done = mobee("estop", "--endpoint", running.endpoint)
    assert done.returncode == 1
    assert "no part of a robot publishes its state" in done.stderr


def test_stop_ends_everything(tmp_path: Path, free_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    launched = Launched(tmp_path, endpoint, toys(one="healthy"))
    try:
        launched.wait_for("all ready")
        done = mobee("stop", "--endpoint", endpoint)
        assert (done.returncode, done.stdout) == (0, "stopped\n")
        assert launched.end()[0] == 0
        assert launched.children() == []
        assert is_free(free_port)
    finally:
        launched.leave_nothing()


@pytest.mark.parametrize("secure", [False, True])
def test_the_router_alone_serves_services_started_by_hand(
    free_port: int, secure: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    endpoint, options, toy_is = f"tcp/127.0.0.1:{free_port}", [], {}
    if secure:
        keys = KeyFolder.new(tmp_path / "keys", [("router", None), ("toy", "client"), ("operator", "operator")]).path
        monkeypatch.setenv("MOBEE_KEYS", str(keys))
        options, toy_is = ["--secure", "--keys", str(keys)], {"MOBEE_IDENTITY": "toy"}
    argv = [sys.executable, "-m", "mobee_cli", "router", "--listen", endpoint, *options]
    router = subprocess.Popen(argv, stderr=subprocess.DEVNULL)
    argv = [sys.executable, "-m", "tests.services.toy_service", "--endpoint", endpoint]
    toy = subprocess.Popen(argv, stderr=subprocess.DEVNULL, env={**os.environ, **toy_is})
    try:
        give_up = time.monotonic() + 60
        while '"toy"' not in mobee("status", "--json", "--endpoint", endpoint).stdout and time.monotonic() < give_up:
            time.sleep(0.05)
        assert mobee("stop", "--endpoint", endpoint).returncode == 0
        assert router.wait(timeout=30) == 0
        assert toy.wait(timeout=30) == 0
    finally:
        for process in (router, toy):
            process.kill()
            process.wait()
