# SPDX-License-Identifier: Apache-2.0
"""Checks before the start: installed packages, free ports, robot and world files."""

from __future__ import annotations

import importlib.util
import socket
import sys
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from mobee.errors import MobeeError, OlderVersion, UnknownName
from mobee.robot.robot import Robot
from services.common.config import ConfigError, nearest
from services.common.worlds import NO_WORLD
from services.launcher.scenario import Part, Scenario


class MissingExtra(Exception):
    """A package that a service needs is not installed; the message holds the remedy."""


class PortInUse(Exception):
    """A port on which a service wants to listen is taken; the message holds the remedy."""


def check_extras(scenario: Scenario) -> None:
    """Raise MissingExtra for the first service whose packages are not installed."""
    for part in scenario.parts:
        for package, extra in {**part.entry.needs, **part.config.packages()}.items():
            if importlib.util.find_spec(package) is None:
                raise MissingExtra(f"{part.who} needs {package}, which is not installed{_remedy(package, extra)}")


def _remedy(package: str, extra: str) -> str:
    if package == "pybullet" and sys.version_info[:2] >= (3, 14):
        version = "{}.{}".format(*sys.version_info)
        return f' and has no wheel for Python {version}: set backend = "mujoco", the physics for every robot and every version'
    return f': pip install "mobee[{extra}]"'


def check_ports(scenario: Scenario) -> None:
    """Raise PortInUse for the first `..._port` setting whose port on the loopback interface is taken."""
    for part in scenario.parts:
        for name in part.config.__struct_fields__:
            if name.endswith("_port") and not _is_free(port := getattr(part.config, name)):
                raise PortInUse(
                    f"port {port} of {part.who} is in use: choose another with --set services.{part.who}.{name}=..., "
                    f"or leave {part.who} out with --headless"
                )


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as servers do: ignore connections that were just closed
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def check_gains(scenario: Scenario) -> None:
    """Raise ConfigError if services would use different gains or terms of the law, which nothing would report later."""
    for what in ("gains", "terms"):
        named = {part.who: str(getattr(part.config, what)) for part in scenario.parts if hasattr(part.config, what)}
        if len(set(named.values())) > 1:
            listed = ", ".join(f"{who} {given}" for who, given in named.items())
            raise ConfigError(
                f"{scenario.where(f'shared.{what}')}: {what} differ: {listed}. All services use one law: set {what} once, as shared.{what}."
            )


def check_rate(scenario: Scenario, robots: Mapping[str, Robot]) -> None:
    """Raise ConfigError if the controller's gains are unstable at the robot's rate, so that it would answer no tick.

    `robots`: as check_robots returns them.
    """
    from mobee.control.gains import Gains
    from mobee.control.stability import require_stable

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
    """Raise ConfigError if only some services run in lockstep, or a number of ticks is set in free mode, where it is not exact."""
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
    """The robots by the name or path that services give for them.

    Raises ConfigError in one line if a robot or world cannot be read, or its file has elements that would be ignored.
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
            raise ConfigError(f"{place}: {part.who}: the robot has no part {name!r}.{nearest(name, robot.parts)}")
        for joint in getattr(part.config, "joints", ()):
            if joint not in robot.part(name).motors:
                place = scenario.where(f"services.{part.who}.joints")
                raise ConfigError(f"{place}: joints: {name} has no motor {joint!r}.{nearest(joint, robot.part(name).motors)}")
    return robots


def check_services(scenario: Scenario, robots: Mapping[str, Robot]) -> None:
    """Raise ConfigError in one line for the first service that cannot serve its robot; `robots`: as check_robots returns them.

    Such a service would end at its start; one that is not vital would be started again and again.
    """
    for part in scenario.parts:
        try:
            part.config.check_robot(robots[part.config.robot])
        except MobeeError as error:
            raise ConfigError(f"{scenario.where(f'services.{part.who}')}: {part.who}: {error}") from None


def _read(scenario: Scenario, part: Part, field: str, read: Callable[[str], Any]) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)  # such as a misspelt name
            warnings.simplefilter("default", OlderVersion)  # such a file is read completely
            return read(getattr(part.config, field))
    except UserWarning as warning:
        raise ConfigError(f"{warning}. The launcher ignores nothing: correct it or take it out.") from None
    except UnknownName as error:
        raise ConfigError(f"{scenario.where(f'services.{part.who}.{field}')}: {field}: {error}") from None
    except MobeeError as error:
        raise ConfigError(str(error)) from None
