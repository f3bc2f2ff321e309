# SPDX-License-Identifier: Apache-2.0
"""Two launchers on one computer, in the places of two hosts."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from experiments.kit.live.launch import free_endpoint
from mobee_cli.__main__ import main
from services.common.observe import Received, alive, listen
from services.common.session import open_client
from services.launcher.connection import join_bus
from services.launcher.hosts import Agreement, JoinRefused, agreement, check_agreement
from services.launcher.scenario import read_scenario
from tests.services.launcher.launched import Launched, mobee, toys, wait_until

Launch = Callable[..., Launched]
TOYS = toys(one="healthy", two="healthy", three="healthy")


@pytest.fixture(scope="module")
def launch(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launch]:
    started: list[Launched] = []

    def start(*options: str, at: str | None = None) -> Launched:
        started.append(Launched(tmp_path_factory.mktemp("launch"), at, TOYS, *options))
        return started[-1]

    yield start
    for launched in started:
        launched.leave_nothing()


def two_hosts(launch: Launch, elsewhere: str) -> tuple[Launched, Launched, str]:
    """A first launcher, one that has joined it as desk, and their endpoint."""
    endpoint = free_endpoint()
    first = launch("--elsewhere", elsewhere, at=endpoint)
    first.wait_for(f"waits for another host to start {elsewhere}, with `mobee launch")
    first.wait_for("one is ready")
    second = launch("--join", endpoint, "--host", "desk", "--only", elsewhere)
    first.wait_for("all ready")
    return first, second, endpoint


@pytest.fixture(scope="module")
def hosts(launch: Launch) -> tuple[Launched, Launched, str]:
    return two_hosts(launch, "two,three")


def test_each_host_starts_its_services_and_the_status_names_the_host(hosts: tuple[Launched, Launched, str]) -> None:
    first, second, endpoint = hosts
    second.wait_for("all ready")
    assert len(first.children()) == 1 and len(second.children()) == 2
    status = json.loads(mobee("status", "--endpoint", endpoint, "--json").stdout)["services"]
    assert {who: (one["state"], one["host"]) for who, one in status.items()} == {
        "launcher": ("ready", None),
        "one": ("ready", None),
        "two": ("ready", "desk"),
        "three": ("ready", "desk"),
        "launcher_desk": ("ready", None),
    }
    lines = mobee("status", "--endpoint", endpoint).stdout.splitlines()
    assert next(line for line in lines if line.startswith("two")).split()[5] == "desk"


def test_a_host_that_does_not_fit_is_refused_in_one_line(launch: Launch, hosts: tuple[Launched, Launched, str]) -> None:
    endpoint = hosts[2]
    cases = {
        ("--only", "tow"): (2, "--only tow: toys has no service 'tow'. Did you mean 'two'? Valid: one, two, three."),
        ("--only", "two"): (3, f"two runs already at {endpoint}"),
        ("--only", "one"): (3, "starts one itself. Launch there with --elsewhere two,three,one, or leave one out of --only"),
        ("--only", "two", "--set", "services.one.seed=7"): (3, f"the scenarios differ: services.one.seed is 7 here and 0 at {endpoint}."),
        ("--only", "two", "--host", "desk"): (3, f"a host named desk has joined {endpoint} already"),
    }
    started = {options: launch("--join", endpoint, *options) for options in cases}
    for options, refused in started.items():
        code, said = cases[options]
        assert refused.end() == (code, {}), refused.news
        assert len(refused.news.splitlines()) == 1
        assert said in refused.news
        assert not (refused.folder / "runs").exists()


def test_all_hosts_end_with_the_first_one_and_are_measured_together(hosts: tuple[Launched, Launched, str]) -> None:
    first, second, _ = hosts
    first.process.send_signal(signal.SIGINT)
    code, summary = first.end()
    assert code == second.end()[0] == 0
    assert summary["services"]["two"]["marks"] == 1
    assert first.children() == second.children() == []


def test_what_another_host_runs_is_judged_and_not_killed_and_the_host_joins_a_new_system(launch: Launch) -> None:
    first, second, endpoint = two_hosts(launch, "two,three")
    events: list[Received] = []
    with open_client(endpoint) as session:
        listen(session, "event/launcher", events.append)
        second.children()[0].kill()
        first.wait_for("is gone (host desk)")
        wait_until(lambda: first.news.count("is ready (host desk)") == 3, 20)
        assert first.news.count("is ready (host desk)") == 3
        stranger = session.liveliness().declare_token("alive/two/i1_stranger")
        wait_until(lambda: len(events) == 2, 10)
        stranger.undeclare()
    assert [event.content()["code"] for event in events] == ["absent", "refused"]
    assert "a second two, i1_stranger, is on the bus beside" in events[1].content()["text"]
    first.process.kill()
    first.process.wait()
    second.wait_for("is not reachable: the services of this host wait for it")
    again = launch("--elsewhere", "two,three", at=endpoint)
    again.wait_for("all ready")
    assert "was started again: this host joins it" in second.news
    second.process.send_signal(signal.SIGINT)
    assert second.end()[0] == 0
    again.wait_for("host desk has left")
    with open_client(endpoint) as session:
        assert set(alive(session)) == {"launcher", "router", "one"}
    assert again.process.poll() is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--elsewhere", "visoin"), "--elsewhere visoin: kinematic has no service 'visoin'."),
        (("--elsewhere", "model", "--set", "shared.mode=lock"), "--elsewhere model: in lockstep every tick waits for model"),
        (("--join", "tcp/127.0.0.1:1"), "--join needs --only"),
        (("--only", "model"), "--only is for a host that joins another one's system: give --join ADDRESS too"),
        (("--join", "tcp/127.0.0.1:1", "--only", "model", "--host", "My desk"), "--host My desk: a name of a host consists of a-z"),
        (("--join", "tcp/127.0.0.1:1", "--only", "model", "--insecure"), "--insecure is for the host with the router"),
        (("--elsewhere", "model,,"), "write the names of services with commas between them, such as vision,monitor"),
    ],
)
def test_options_that_do_not_fit_are_refused(options: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        raise SystemExit(main(["launch", "kinematic", *options]))
    assert end.value.code == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_a_host_that_cannot_be_reached_is_named(free_port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.launcher.connection.JOIN_PATIENCE", 0.0)
    here = read_scenario("kinematic").only(["model"])
    with pytest.raises(JoinRefused, match=rf"no router at tcp/127.0.0.1:{free_port} within 0 s .*Does the system run there"):
        join_bus(read_scenario("kinematic"), here, f"tcp/127.0.0.1:{free_port}", "desk", None)


def test_another_version_of_mobee_is_named() -> None:
    own = agreement(read_scenario("kinematic"), "i1", ("model",))
    first = Agreement(version="9.9", instance=own.instance, elsewhere=own.elsewhere, services=own.services)
    with pytest.raises(JoinRefused, match=r"MoBeE is .* here and 9\.9 at tcp/robot:7447: install the same version on both hosts"):
        check_agreement(first, own, ["model"], "tcp/robot:7447")


def test_the_place_of_a_robot_file_may_differ_and_its_content_may_not(tmp_path: Path) -> None:
    agreed = {}
    for host, content in (("robot", "<robot/>"), ("desk", "<robot/>"), ("lab", "<robot />")):
        (tmp_path / host).mkdir()
        (tmp_path / host / "own.xml").write_text(content)
        agreed[host] = agreement(read_scenario("kinematic", [f"shared.robot={tmp_path / host / 'own.xml'}", "shared.world=none"]))
    first = Agreement(version=agreed["robot"].version, instance="i1", elsewhere=("model",), services=agreed["robot"].services)
    check_agreement(first, agreed["desk"], ["model"], "tcp/robot:7447")
    with pytest.raises(JoinRefused, match=r'services\.robot_sim\.robot is "a file with the SHA-256 '):
        check_agreement(first, agreed["lab"], ["model"], "tcp/robot:7447")
