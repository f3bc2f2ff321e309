# SPDX-License-Identifier: Apache-2.0
"""Checks before the start of a scenario (a set of services with their settings).

They concern installed packages, free ports, robot and world files, and settings that must agree.
"""

from __future__ import annotations

import importlib.util
import socket
import sys
import time
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from typing import Any

from bus_schema import keys
from bus_schema.authority import AGENT
from bus_schema.rpc import Empty, Stat
from mobee.errors import MobeeError, OlderVersion, Simplified, UnknownName
from mobee.robot.robot import Robot
from services.common import rpc
from services.common.config import ConfigError, nearest
from services.common.identity import DEFAULT_ENDPOINT
from services.common.session import BusUnreachable, open_client
from services.common.worlds import NO_WORLD, robot_hash
from services.launcher.scenario import Part, Scenario

_CONNECT_TIMEOUT, _ANSWER_TIMEOUT = 0.5, 1.0  # s: a system that runs answers at once


class MissingExtra(Exception):
    """Raised if a Python package that a service needs is not installed. The message names the command that installs it."""


class PortInUse(Exception):
    """Raised if another program uses a port at which a service should listen. The message says how to choose another port."""


class SystemRuns(Exception):
    """Raised if another system runs at the router's endpoint.

    Also raised if a port is in use and a system runs at the default endpoint, because that system is probably using it. The message
    describes the other system and says how to end it.
    """


def check_extras(scenario: Scenario) -> None:
    """Raise MissingExtra for the first service that needs a Python package which is not installed."""
    for part in scenario.parts:
        for package, extra in {**part.entry.needs, **part.config.packages()}.items():
            if importlib.util.find_spec(package) is None:
                raise MissingExtra(f"{part.who} needs {package}, which is not installed{_remedy(package, extra)}")


def _remedy(package: str, extra: str) -> str:
    if package == "pybullet" and sys.version_info[:2] >= (3, 14):
        version = "{}.{}".format(*sys.version_info)
        return f' and has no wheel for Python {version}: set backend = "mujoco", the physics for every robot and every version'
    return f': pip install "mobee[{extra}]"'


def check_endpoint(scenario: Scenario, endpoint: str) -> None:
    """Raise SystemRuns if a system already runs at `endpoint`, the address of the router.

    If a port of this scenario is in use, the default endpoint is checked too, because the system there may use the port.
    """
    ports = _ports(scenario)
    taken = any(not _is_free(port) for _, _, port in ports)
    for place in dict.fromkeys([endpoint, *([DEFAULT_ENDPOINT] if taken else [])]):
        if stat := launcher_at(place):
            raise SystemRuns(_two_systems(stat, place, endpoint, ports))


def check_ports(scenario: Scenario) -> None:
    """Raise PortInUse for the first port that is in use on the loopback interface, among all settings whose names end in `_port`."""
    for who, name, port in _ports(scenario):
        if _is_free(port):
            continue
        raise PortInUse(
            f"port {port} of {who} is in use: choose another with --set services.{who}.{name}={_free_port(port + 1)}, "
            f"or leave {who} out with --headless"
        )


def _ports(scenario: Scenario) -> list[tuple[str, str, int]]:
    """Return service, name and value of each `..._port` setting."""
    settings = [(part.who, name, getattr(part.config, name)) for part in scenario.parts for name in part.config.__struct_fields__]
    return [(who, name, port) for who, name, port in settings if name.endswith("_port")]


def launcher_at(endpoint: str) -> Stat | None:
    """Return the status of the launcher whose router listens at a TCP endpoint; None if no launcher answers there."""
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_CONNECT_TIMEOUT).close()
        with open_client(endpoint, patience=0.0) as session:
            return rpc.call(session, "mobee", keys.service_rpc("launcher", "stat"), Empty, Stat, timeout=_ANSWER_TIMEOUT, tries=2)
    except (OSError, ValueError, BusUnreachable, rpc.CallFailed):  # nobody listens, it is no router, or one without a launcher
        return None


def _two_systems(stat: Stat, place: str, endpoint: str, ports: Sequence[tuple[str, str, int]]) -> str:
    """Describe the system that runs, how to end it, and how to start another beside it."""
    since = time.strftime("%H:%M:%S", time.localtime(time.time() - stat.uptime))
    at = "" if place == DEFAULT_ENDPOINT else f" --endpoint {place}"
    options = [f"--endpoint {_next_endpoint(endpoint)}" if place == endpoint else ""]
    chosen: list[int] = []
    for who, name, port in ports:
        chosen.append(_free_port(port + 1, without=chosen))
        options.append(f"--set services.{who}.{name}={chosen[-1]}")
    return (
        f"a system runs already at {place}, since {since} ({stat.uptime / 60:.0f} min, launcher {stat.pid}): {stat.text}. "
        f"End it with `mobee stop{at}`, or start this one beside it with {' '.join(filter(None, options))}"
    )


def _next_endpoint(endpoint: str) -> str:
    host, _, port = endpoint.rpartition(":")
    return f"{host}:{_free_port(int(port) + 1)}"


def _free_port(first: int, without: Collection[int] = ()) -> int:
    return next((port for port in range(first, 65536) if port not in without and _is_free(port)), first)


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as servers do: ignore connections that were just closed
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def check_gains(scenario: Scenario) -> None:
    """Raise ConfigError if two services have different values of the setting `gains` or `terms`, because all must use one control law."""
    for what in ("gains", "terms"):
        named = {part.who: str(getattr(part.config, what)) for part in scenario.parts if hasattr(part.config, what)}
        if len(set(named.values())) > 1:
            listed = ", ".join(f"{who} {given}" for who, given in named.items())
            raise ConfigError(
                f"{scenario.where(f'shared.{what}')}: {what} differ: {listed}. All services use one law: set {what} once, as shared.{what}."
            )


def check_rate(scenario: Scenario, robots: Mapping[str, Robot]) -> None:
    """Raise ConfigError if the controller's gains are unstable at the rate of robot_sim; the controller would then answer no tick.

    `robots`: the robots by name or path, as returned by `check_robots`.
    """
    from mobee.control.gains import Gains
    from mobee.control.law import require_stable

    configs = {part.entry.module: part.config for part in scenario.parts}
    controller = configs.get("services.controller")
    rate, gains = getattr(configs.get("services.robot_sim"), "rate", None), getattr(controller, "gains", None)
    if controller is None or rate is None or gains is None:
        return
    try:
        require_stable(robots[controller.robot], Gains.named(gains), 1.0 / rate)
    except MobeeError as error:
        raise ConfigError(f"{scenario.where('services.robot_sim.rate')}: rate {rate:g} Hz: {error}") from None


def check_lockstep(scenario: Scenario) -> None:
    """Raise ConfigError if only some services are set to lockstep, or if a number of ticks is set without lockstep.

    In lockstep every tick waits for all participants; without it, the run would not end after exactly this number of ticks.
    """
    modes = {part.who: part.config.mode for part in scenario.parts}
    if len(set(modes.values())) > 1:
        listed = ", ".join(f"{who} {mode}" for who, mode in modes.items())
        raise ConfigError(
            f"{scenario.where('shared.mode')}: modes differ: {listed}. All services run in lockstep or none: set mode once, as shared.mode."
        )
    for part in scenario.parts:
        if getattr(part.config, "ticks", 0) and not scenario.is_locked:
            raise ConfigError(
                f"{scenario.where('services.robot_sim.ticks')}: a number of ticks is exact in lockstep only: set shared.mode=lock"
            )


def check_robots(scenario: Scenario) -> dict[str, Robot]:
    """Load the robots of all services; return a dict from the name or path in their settings to the robot.

    Raises ConfigError with a message of one line if a robot or world cannot be read, if its file has elements that would be ignored,
    if a service names a part or motor that its robot does not have, or if shipped services have different robots.
    """
    from mobee.model.world_file import load_world
    from mobee.robot.load import load_robot

    read_robot, read_world = cache(load_robot), cache(load_world)
    robots: dict[str, Robot] = {}
    for part in scenario.parts:
        robot = robots[part.config.robot] = _read(scenario, part, "robot", read_robot)
        if getattr(part.config, "world", "") not in ("", NO_WORLD):
            _read(scenario, part, "world", read_world)
        name = getattr(part.config, "part", None)
        if name is not None and name not in robot.parts:
            place = scenario.where(f"services.{part.who}")
            raise ConfigError(
                f"{place}: {part.who}: the robot has no part {name!r}.{nearest(name, robot.parts)} An agent is named after its part, as "
                f"[services.{AGENT}{next(iter(robot.parts))}]: write a scenario for this robot (docs/robots.md)."
            )
        for joint in getattr(part.config, "joints", ()):
            if joint not in robot.part(name).motors:
                place = scenario.where(f"services.{part.who}.joints")
                raise ConfigError(f"{place}: joints: {name} has no motor {joint!r}.{nearest(joint, robot.part(name).motors)}")
    named = {part.who: part.config.robot for part in scenario.parts if part.entry.module.startswith("services.")}
    if len({robot_hash(robots[robot]) for robot in named.values()}) > 1:
        listed = ", ".join(f"{who} {robot}" for who, robot in named.items())
        raise ConfigError(
            f"{scenario.where('shared.robot')}: robots differ: {listed}. All services serve one robot: set it as shared.robot."
        )
    return robots


def check_services(scenario: Scenario, robots: Mapping[str, Robot]) -> None:
    """Raise ConfigError, with a message of one line, for the first service whose settings do not fit its robot.

    Without this check, such a service would fail only after the system has started. `robots`: as returned by `check_robots`.
    """
    for part in scenario.parts:
        try:
            part.config.check_robot(robots[part.config.robot])
        except MobeeError as error:
            raise ConfigError(f"{scenario.where(_setting_in(part, str(error)))}: {part.who}: {error}") from None


def _setting_in(part: Part, text: str) -> str:
    """Return the setting of a service that an error message is about, as "services.NAME.SETTING".

    It is the first setting whose value is a string that the message `text` quotes. If there is none, the result is "services.NAME".
    """
    values = ((name, getattr(part.config, name)) for name in part.config.__struct_fields__)
    named = next((f".{name}" for name, value in values if isinstance(value, str) and value and repr(value) in text), "")
    return f"services.{part.who}{named}"


def _read(scenario: Scenario, part: Part, field: str, read: Callable[[str], Any]) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)  # for example a misspelt name
            for harmless in (OlderVersion, Simplified):  # such a file is read completely, or as far as this library can use it
                warnings.simplefilter("default", harmless)
            return read(getattr(part.config, field))
    except UserWarning as warning:
        raise ConfigError(f"{warning}. The launcher ignores nothing: correct it or take it out.") from None
    except UnknownName as error:
        raise ConfigError(f"{scenario.where(f'services.{part.who}.{field}')}: {field}: {error}") from None
    except MobeeError as error:
        raise ConfigError(str(error)) from None
