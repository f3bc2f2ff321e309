# SPDX-License-Identifier: Apache-2.0
"""Intruders in a secured system: without keys, with keys of others, and with the keys of another role.

Each is refused, and the refusal is reported with the identity and the key.  The system is one for all tests, and continues.
"""

from __future__ import annotations

import json
import logging
import os
import re
import socket
import ssl
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.authority import party_of
from bus_schema.messages import Command, Commands, EStop, Forces, Message, StepDone, Tick, WorldObject
from bus_schema.rpc import Done, Empty, Goal, OneName, Place, Request, Stat, Take, WithEpoch
from mobee import load_robot
from services.common import rpc
from services.common.bus import Bus
from services.common.certificates import KeyFolder
from services.common.identity import Identity
from services.common.observe import alive
from services.common.rpc import CallFailed
from services.common.session import BusUnreachable, open_client
from tests.system.live import Launch, Watcher, acting_as, running, until

pytestmark = [pytest.mark.system, pytest.mark.untimed]
ROBOT = load_robot("icub")
MOTORS = len(ROBOT.motors)
SERVICES = ("robot_sim", "model", "controller", "agent_left_arm", "recorder", "vision", "launcher")
IDENTITIES = (*SERVICES, "agent_torso", "monitor", "operator", "observer")
SLOW = ("services.robot_sim.speed=1.0", "services.robot_sim.rate=50")  # a quarter of the messages; the robot need not learn
UNKNOWN = 65534  # number of a user who owns nothing here
SETTLE = 0.3  # s in which a message would arrive


def make_keys(folder: Path, *names: str, days: int = 30) -> Path:
    KeyFolder.new(folder, [("router", None), *((name, party_of(name)) for name in names)], days)
    return folder


@dataclass
class Secured:
    """A secured system, its keys, and what its launcher reports."""

    system: Launch
    watcher: Watcher
    keys: Path
    pids: dict[str, int] = field(default_factory=dict)

    @contextmanager
    def session_of(self, name: str, keys: Path | None = None) -> Iterator[zenoh.Session]:
        with acting_as(Identity(keys or self.keys, name)):
            session = open_client(self.system.endpoint, patience=10.0)
        with session:
            yield session

    def reports(self) -> list[str]:
        return [event.text for event in self.watcher.events if event.code == "access"]

    def is_reported(self, text: str) -> None:
        until(lambda: any(text in said for said in self.reports()), 20.0, f"the launcher reports {text!r}, not only {self.reports()}")

    def header(self, src: str = "intruder") -> dict[str, Any]:
        clock = self.watcher.clock
        assert clock is not None
        return {"v": VERSION, "run": clock.run, "src": src, "seq": 10**9, "k": clock.k, "t": clock.t, "tw": time.monotonic_ns()}

    def epoch(self, part: str) -> int:
        return self.watcher.states[part][-1].epoch

    def instance(self, who: str) -> str:
        return alive(self.watcher.session)[who][0]


def authority_of(secured: Secured, folder: Path) -> Path:
    """Copy the certificate and the key of the system's authority into a new folder, and return it."""
    folder.mkdir(mode=0o700)
    for name in ("ca.crt", "ca.key"):
        (folder / name).write_bytes((secured.keys / name).read_bytes())
        (folder / name).chmod(0o600)
    return folder


@pytest.fixture(scope="module")
def secured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secured]:
    folder = tmp_path_factory.mktemp("intruders")
    made = make_keys(folder / "keys", *IDENTITIES, "renderer")
    with running(folder, "tests/system/one_arm.toml", *SLOW, keys=made) as (system, watcher):
        found = Secured(system, watcher, made)
        found.pids = {who: watcher.pid(who) for who in ("robot_sim", "model", "controller", "agent_left_arm")}
        until(lambda: watcher.states["head"] and watcher.states["head"][-1].gate == "armed", 20.0, "the robot is armed")
        yield found


def test_services_with_their_keys_are_refused_nothing(secured: Secured) -> None:
    assert secured.reports() == []
    assert "access" not in secured.watcher.stat("launcher").rejected


# Without valid keys


@pytest.mark.parametrize("endpoint", ["tcp", "tls"])
def test_a_process_without_a_certificate_does_not_get_in(secured: Secured, endpoint: str) -> None:
    with acting_as(None), pytest.raises(BusUnreachable, match="keys with --keys, if it is secured"):
        open_client(secured.system.endpoint.replace("tcp/", f"{endpoint}/"), patience=0.0)
    if endpoint == "tcp":
        secured.is_reported("a connection was refused: received corrupt message")


def test_a_process_that_shows_no_certificate_does_not_get_in(secured: Secured) -> None:
    config = zenoh.Config()
    for path, value in {
        "mode": "client",
        "connect/endpoints": [secured.system.endpoint.replace("tcp/", "tls/")],
        "connect/timeout_ms": 500,
        "scouting/multicast/enabled": False,
        "transport/link/tls": {"root_ca_certificate": str(secured.keys / "ca.crt"), "verify_name_on_connect": False},
    }.items():
        config.insert_json5(path, json.dumps(value))
    with pytest.raises(zenoh.ZError):
        zenoh.open(config)
    secured.is_reported("a connection was refused: peer sent no certificates")


def test_a_process_with_the_certificate_of_another_authority_does_not_get_in(secured: Secured, tmp_path: Path) -> None:
    other = make_keys(tmp_path / "keys", "controller")
    with acting_as(Identity(other, "controller")), pytest.raises(BusUnreachable, match="other keys than"):
        open_client(secured.system.endpoint, patience=0.0)
    (other / "ca.crt").write_bytes((secured.keys / "ca.crt").read_bytes())  # then it accepts the router, but not the router it
    with acting_as(Identity(other, "controller")), pytest.raises(BusUnreachable):
        open_client(secured.system.endpoint, patience=0.0)
    secured.is_reported("a connection was refused: invalid peer certificate: UnknownIssuer")


def test_a_process_with_an_expired_certificate_does_not_get_in(secured: Secured, tmp_path: Path) -> None:
    old = authority_of(secured, tmp_path / "keys")
    KeyFolder(old).add([("controller", "controller")], days=0)
    time.sleep(1.0)  # certificates count whole seconds: it expires in this one
    with acting_as(Identity(old, "controller")), pytest.raises(BusUnreachable):
        open_client(secured.system.endpoint, patience=0.0)
    secured.is_reported("a connection was refused: invalid peer certificate: certificate expired")


def test_an_identity_that_the_launcher_does_not_know_may_do_nothing(secured: Secured, tmp_path: Path) -> None:
    later = authority_of(secured, tmp_path / "keys")
    KeyFolder(later).add([("stranger", "operator")])
    with secured.session_of("stranger", later) as session:
        assert alive(session) == {}
        with pytest.raises(CallFailed):
            rpc.call(session, "stranger", keys.ESTOP_RESET, Empty, Done)
    secured.is_reported("has a certificate of no identity that this system knows")


def test_the_authority_and_one_identity_are_enough_on_another_host(secured: Secured, tmp_path: Path) -> None:
    there = tmp_path / "keys"
    there.mkdir(mode=0o700)
    for name in ("ca.crt", "observer.crt", "observer.key"):
        (there / name).write_bytes((secured.keys / name).read_bytes())
        (there / name).chmod(0o600)
    environment = {**os.environ, "MOBEE_KEYS": str(there), "MOBEE_IDENTITY": "observer"}
    command = [sys.executable, "-m", "mobee_cli", "topic", "list", "--endpoint", secured.system.endpoint]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment)
    assert done.returncode == 0, done.stderr
    assert {"clock", "commands", "left_arm/state"} <= {line.split()[0] for line in done.stdout.splitlines()}


@pytest.mark.parametrize(("name", "is_router"), [("router", True), ("controller", False)])
def test_only_the_router_may_listen(secured: Secured, free_port: int, name: str, is_router: bool) -> None:
    config, identity = zenoh.Config(), Identity(secured.keys, name)
    shown = {"listen_certificate": str(identity.certificate), "listen_private_key": str(identity.key)}
    for path, value in {
        "mode": "router",
        "listen/endpoints": [f"tls/127.0.0.1:{free_port}"],
        "scouting/multicast/enabled": False,
        "transport/link/tls": {"root_ca_certificate": str(identity.authority), "enable_mtls": True, **shown},
    }.items():
        config.insert_json5(path, json.dumps(value))
    connects = nullcontext() if is_router else pytest.raises(BusUnreachable)
    with zenoh.open(config), acting_as(Identity(secured.keys, "observer")), connects:
        open_client(f"tls/127.0.0.1:{free_port}", patience=0.0).close()


# Messages under another name (S12)


def forged(secured: Secured) -> dict[str, Message]:
    """A message of each stream that moves the robot, or makes others believe something, by its key."""
    head, q = secured.header(), [0.0] * MOTORS
    parts = {"head": {"epoch": secured.epoch("head"), "mode": "velocity"}}
    commands = {**head, "re_k": head["k"], "parts": parts, "ref": [0.5] * MOTORS, "ttl": 100, "answer": None}
    size = len(ROBOT.parts["head"])
    command = {**head, "epoch": secured.epoch("head"), "re_k": head["k"], "mode": "velocity", "ref": [0.5] * size, "ttl": 100}
    forces = {**head, "re_k": head["k"], "terms": {"limits": [3e5] * MOTORS}, "part_age": {}, "touched": {}}
    thing = {
        "name": "table",
        "geometry": {"kind": "sphere", "size": [0.01]},
        "position": [7.0, 0.0, 0.0],
        "quaternion": [1.0, 0.0, 0.0, 0.0],
    }
    seen = {**head, **thing, "covariance": [0.0] * 9, "role": "ghost", "t_capture": 0, "valid_until": 2**61}
    return {
        "commands": msgspec.convert(commands, Commands),
        "head/cmd": msgspec.convert(command, Command),
        "model/forces": msgspec.convert(forces, Forces),
        "world/table": msgspec.convert(seen, WorldObject),
        "tick": msgspec.convert({**head, "dt": 10**7, "mode": "free", "rate": 1e3, "q": q, "parts": {}}, Tick),
        "done": msgspec.convert({**head, "re_k": head["k"] + 10**6, "last": True}, StepDone),
    }


@pytest.mark.parametrize(
    ("identity", "key"),
    [
        ("observer", "commands"),
        ("vision", "commands"),
        ("agent_left_arm", "commands"),
        ("operator", "commands"),
        ("agent_left_arm", "head/cmd"),
        ("vision", "model/forces"),
        ("controller", "model/forces"),
        ("observer", "world/table"),
        ("agent_left_arm", "tick"),
        ("model", "tick"),
        ("model", "done/controller"),
        ("agent_torso", "done/agent_left_arm"),
    ],
)
def test_a_message_of_another_service_is_not_delivered(secured: Secured, identity: str, key: str) -> None:
    message = forged(secured)[key if not key.startswith("done/") else "done"]
    delivered: list[str] = []
    subscriber = secured.watcher.session.declare_subscriber("**", lambda sample: delivered.append(str(sample.payload.to_bytes())))
    with secured.session_of(identity) as session:
        for _ in range(3):
            session.put(key, encode(message), encoding=encoding_of(type(message)))
        secured.is_reported(f"{identity} may not publish on icub/{key}")
    time.sleep(SETTLE)
    subscriber.undeclare()
    assert delivered
    assert not [payload for payload in delivered if "intruder" in payload]


# Calls (S12)


def owner(secured: Secured, who: str) -> dict[str, Any]:
    return {"instance": secured.instance(who)}


CALLS: dict[str, tuple[type[Request], Callable[[Secured], dict[str, Any]]]] = {
    "head/rpc/drive/take": (Take, lambda secured: owner(secured, "controller")),
    "head/rpc/drive/arm": (WithEpoch, lambda secured: {"epoch": secured.epoch("head")}),
    "head/rpc/drive/release": (WithEpoch, lambda secured: {"epoch": secured.epoch("head")}),
    "head/rpc/drive/hold": (WithEpoch, lambda secured: {"epoch": secured.epoch("head")}),
    "left_arm/rpc/take": (Take, lambda secured: owner(secured, "agent_left_arm")),
    "left_arm/rpc/goal": (Goal, lambda secured: {"epoch": 1, "action_id": "x", "q": [0.0] * len(ROBOT.parts["left_arm"])}),
    "model/rpc/world/remove": (OneName, lambda secured: {"name": "table"}),
    "sim/rpc/pause": (Empty, lambda secured: {}),
    "sim/rpc/reset": (Empty, lambda secured: {}),
    "sim/rpc/place": (Place, lambda secured: {"name": "ball", "position": [0.0, 0.0, 1.0]}),
    "estop/rpc/reset": (Empty, lambda secured: {}),
    "controller/rpc/shutdown": (Empty, lambda secured: {}),
    "launcher/rpc/shutdown": (Empty, lambda secured: {}),
    "agent_left_arm/rpc/rest": (Empty, lambda secured: {}),
}


@pytest.mark.parametrize(
    ("identity", "key"),
    [
        *(("observer", key) for key in CALLS),
        *(("vision", key) for key in CALLS),
        ("operator", "head/rpc/drive/take"),  # the drive belongs to the controller alone
        ("agent_torso", "left_arm/rpc/take"),  # of another part
        ("agent_torso", "left_arm/rpc/goal"),
        ("model", "head/rpc/drive/take"),
    ],
)
def test_a_call_that_is_not_the_callers_is_not_answered(secured: Secured, identity: str, key: str) -> None:
    request, arguments = CALLS[key]
    with secured.session_of(identity) as session:
        with pytest.raises(CallFailed, match="no service answers") as failed:
            rpc.call(session, "intruder", key, request, Done, **arguments(secured))
        assert failed.value.code == "no_answer"
    secured.is_reported(f"{identity} may not call icub/{key}")


# Tokens and second processes (S5, S9)


@pytest.mark.parametrize("who", ["router", "launcher", "model", "controller", "robot_sim", "agent_left_arm"])
def test_a_token_of_another_service_is_not_seen(secured: Secured, who: str) -> None:
    taken = secured.instance(who)
    with secured.session_of("vision") as session:
        tokens = [session.liveliness().declare_token(keys.alive(who, instance)) for instance in (taken, "i1_forged")]
        secured.is_reported(f"vision may not declare the token icub/alive/{who}/i1_forged")
        secured.is_reported(f"vision may not declare the token icub/alive/{who}/{taken}")
        assert alive(secured.watcher.session)[who] == [taken]
        for token in tokens:
            token.undeclare()
    time.sleep(SETTLE)
    assert alive(secured.watcher.session)[who] == [taken]  # the real one outlives the squatted one


@pytest.mark.parametrize("who", ["robot_sim", "model", "controller"])
def test_a_second_process_of_one_name_does_not_make_the_launcher_kill_the_right_one(secured: Secured, who: str) -> None:
    def answer(query: zenoh.Query) -> None:
        numbers: dict[str, float | None] = {}
        stat = Stat(v=VERSION, who=who, instance="i1_x", pid=1, uptime=1.0, ready=True, text="", numbers=numbers, rejected={})
        query.reply(query.key_expr, encode(stat), encoding=encoding_of(Stat))

    with secured.session_of("vision") as session:
        queryable = session.declare_queryable(keys.service_rpc(who, "stat"), answer)
        secured.is_reported(f"vision may not answer icub/{who}/rpc/stat")
        time.sleep(1.2)  # two calls of the launcher
        assert secured.watcher.stat(who).pid == secured.pids[who]
        queryable.undeclare()


def test_a_service_that_a_stranger_starts_ends(secured: Secured) -> None:
    identity = Identity(secured.keys, "vision")
    command = [sys.executable, "-m", "services.model", "--endpoint", secured.system.endpoint]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env={**os.environ, **identity.environment()})
    assert done.returncode == 3
    assert f"model runs already at {secured.system.endpoint} (process {secured.pids['model']})" in done.stderr
    secured.is_reported("vision may not answer icub/model/rpc/pulse")


# The emergency stop


def test_every_identity_may_stop_the_robot_and_a_person_releases_it(secured: Secured) -> None:
    states = secured.watcher.states
    with secured.session_of("observer") as session:
        stop = Bus(session, "observer", logging.getLogger("observer")).publisher(EStop)

        def stopped() -> bool:
            stop.put(set=True, source="observer", reason="test")
            time.sleep(0.05)
            return all(seen[-1].gate == "estop" for seen in states.values())

        until(stopped, 5.0, "all parts are stopped")
        with pytest.raises(CallFailed):
            rpc.call(session, "observer", keys.ESTOP_RESET, Empty, Done)
        stop.put(set=False, source="observer", reason="forged")
        time.sleep(SETTLE)
        assert all(seen[-1].gate == "estop" for seen in states.values())
    command = [sys.executable, "-m", "mobee_cli", "estop", "--reset", "--endpoint", secured.system.endpoint]
    refused = subprocess.run([*command], capture_output=True, text=True, timeout=60, env={**os.environ, "MOBEE_KEYS": ""})
    assert refused.returncode == 3
    assert "with --keys" in refused.stderr
    done = subprocess.run([*command, "--keys", str(secured.keys)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    until(lambda: all(seen[-1].gate == "armed" for seen in states.values()), 20.0, "the robot is armed again")


def fail_handshakes(port: int, over: threading.Event) -> None:
    """Connect again and again without a certificate."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    while not over.is_set():
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0) as plain, context.wrap_socket(plain) as link:
            link.recv(1)


def test_strangers_who_connect_again_and_again_do_not_keep_the_operator_out(secured: Secured) -> None:
    port, over = int(secured.system.endpoint.rpartition(":")[2]), threading.Event()
    strangers = [threading.Thread(target=fail_handshakes, args=(port, over)) for _ in range(20)]
    for stranger in strangers:
        stranger.start()
    try:
        time.sleep(1.0)
        with acting_as(Identity(secured.keys, "operator")), open_client(secured.system.endpoint, patience=0.0) as session:
            assert set(secured.pids) <= set(alive(session))
        assert secured.watcher.pid("model") == secured.pids["model"]  # who is connected stays connected
    finally:
        over.set()
        for stranger in strangers:
            stranger.join()


# Another user of the same computer


def test_another_user_of_the_computer_reads_neither_keys_nor_runs(secured: Secured) -> None:
    private = [secured.keys, *secured.keys.glob("*.key"), *secured.keys.glob("*.crt"), secured.system.run_dir]
    assert all(stat.S_IMODE(path.stat().st_mode) & 0o077 == 0 for path in private)
    if os.geteuid() == 0:
        for path in (secured.keys / "operator.key", secured.system.run_dir / "scenario.toml"):
            assert subprocess.run(["cat", str(path)], user=UNKNOWN, group=UNKNOWN, capture_output=True).returncode != 0
        assert list(secured.keys.glob("*.sock"))
        assert subprocess.run(["ls", str(secured.keys)], user=UNKNOWN, group=UNKNOWN, capture_output=True).returncode != 0


# At the end of all of it


def test_the_system_has_gone_on_with_the_same_processes(secured: Secured) -> None:
    assert {who: secured.watcher.pid(who) for who in secured.pids} == secured.pids
    launcher = secured.watcher.stat("launcher")
    assert not any(count for name, count in launcher.numbers.items() if name.startswith("restarts_"))
    log = secured.system.log("launcher")
    assert re.search(r"WARNING launcher access: vision may not call icub/head/rpc/drive/take", log)
    until(lambda: secured.watcher.motions["left_arm"][-1].status == "moving", 30.0, "the agent continues")
