# SPDX-License-Identifier: Apache-2.0
"""Reads a scenario (services and their settings) from a TOML file, and checks it before any service starts."""

from __future__ import annotations

import importlib
import re
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from msgspec import Struct, structs, to_builtins

from bus_schema.authority import HOST_LAUNCHER
from services.common.config import ConfigError, ServiceConfig, WorldConfig, convert, line_of, nearest
from services.common.worlds import effective_world, is_path
from services.launcher.catalogue import NAMES, RECORDER, Entry, entry_of

SHIPPED = Path(__file__).parent / "scenarios"


class _File(Struct, forbid_unknown_fields=True):
    """The top level of a scenario file."""

    title: str = ""
    shared: dict[str, Any] = {}
    services: dict[str, dict[str, Any]] = {}


@dataclass(frozen=True)
class Part:
    """A service of a scenario, with all its settings.

    `who`: name. `entry`: fixed properties of the service. `config`: its settings. `given`: names of the settings that the scenario sets;
    all others have their default values.
    """

    who: str
    entry: Entry
    config: ServiceConfig
    given: frozenset[str]


@dataclass(frozen=True)
class Scenario:
    """The services to launch, in the order in which they are listed and started.

    `name`: name of the file. `title`: text for the user. `shared`: settings for all services that have a field of that name. `parts`: the
    services. `where`: function from the name of a field, such as "shared.robot", to its place in the file, for messages.
    """

    name: str
    title: str
    shared: Mapping[str, Any]
    parts: tuple[Part, ...]
    where: Callable[[str], str]

    @property
    def is_locked(self) -> bool:
        """Whether the scenario runs in lockstep (every tick waits for all participants)."""
        return any(part.who == "robot_sim" and part.config.mode == "lock" for part in self.parts)

    def only(self, names: Collection[str]) -> Scenario:
        """Return a copy of the scenario with only the services in `names`."""
        return replace(self, parts=tuple(part for part in self.parts if part.who in names))

    def as_tables(self, configs: Mapping[str, ServiceConfig]) -> dict[str, Any]:
        """Return the scenario as tables of a TOML file, with every setting of every service.

        `configs`: settings by the name of the service.
        """
        services = {}
        for part in self.parts:
            module = {} if part.entry == entry_of(part.who, None) else {"module": part.entry.module}
            services[part.who] = {**module, **to_builtins(configs[part.who])}
        return {"title": self.title, "services": services}


def shipped() -> dict[str, Path]:
    """Return a dict from the name of each shipped scenario to its file."""
    return {path.stem: path for path in sorted(SHIPPED.glob("*.toml"))}


def read_scenario(
    name_or_path: str,
    settings: Sequence[str] = (),
    leave_out: Sequence[str] = (),
    with_also: Sequence[str] = (),
    record: bool = False,
) -> Scenario:
    """Read a scenario, shipped or from a file, and return it.

    Args:
        name_or_path: name of a shipped scenario, or path of a .toml file.
        settings: changes, each "table.field=value", which replace values of the file.
        leave_out: services that are not started.
        with_also: services that are started even if the file does not name them.
        record: whether to add the recorder, if the scenario has the shipped robot_sim.

    Raises:
        ConfigError: the file cannot be read, or a name or value in it is not valid. The message has one line with the place, the field and
            the nearest valid name.
    """
    path = _find(name_or_path)
    try:
        text = path.read_text()
        data = tomllib.loads(text)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file. Give a scenario file, or a shipped scenario: {', '.join(shipped())}.") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{path}: nested too deeply") from None
    _place_files(data, path.parent)
    services = data["services"] if isinstance(data.get("services"), dict) else {}
    also = [*with_also, *([RECORDER] if record and _has_robot(services) else [])]
    added = [services.setdefault(who, {}) for who in also if services and who not in services]
    origins = _override(data, settings)
    sim = services.get("robot_sim")
    for table in added:
        if isinstance(sim, dict) and "robot" in sim:  # else they have the shared one
            table.setdefault("robot", sim["robot"])

    def place(field: str) -> str:
        for name, setting in origins.items():
            if f"{field}.".startswith(f"{name}."):
                return f"--set {setting}"
        line = line_of(text, field)
        return f"{path}:{line}" if line else str(path)

    file = convert(data, _File, place)
    where = _where_or_shared(file, place)
    parts = [_part(who, table, file.shared, where) for who, table in file.services.items()]
    if not parts:
        raise ConfigError(f"{path}: no services: name at least one as [services.<name>]. Valid: {', '.join(NAMES)}.")
    _check_shared(file.shared, parts, where)
    kept = _for_lockstep([part for part in parts if part.who not in leave_out])
    return Scenario(path.stem, file.title, file.shared, tuple(sorted(kept, key=lambda part: part.entry.stage)), where)


FILES = ("robot", "world", "continues", "calibration", "detector")  # settings that may name a file


def _place_files(data: dict[str, Any], folder: Path) -> None:
    """Replace the names of files that lie beside the scenario, and not in the working directory, by their paths."""
    services = data.get("services")
    tables = [data.get("shared"), *(services.values() if isinstance(services, dict) else ())]
    for table in tables:
        for name in FILES:
            value = table.get(name) if isinstance(table, dict) else None
            if isinstance(value, str) and is_path(value) and not Path(value).exists() and (folder / value).exists():
                table[name] = str(folder / value)


def _has_robot(services: dict[str, Any]) -> bool:
    """Return whether a scenario has the shipped robot_sim: a recording is of little use without its ticks."""
    sim = services.get("robot_sim")
    return isinstance(sim, dict) and "module" not in sim


def _find(name_or_path: str) -> Path:
    names = shipped()
    if name_or_path in names:
        return names[name_or_path]
    if name_or_path.endswith(".toml") or "/" in name_or_path:
        return Path(name_or_path)
    if name_or_path.endswith((".xml", ".urdf")):
        raise ConfigError(
            f"{name_or_path} is the file of a robot or a world, not a scenario: name it in a scenario, as in "
            f"`mobee launch kinematic --set shared.robot={name_or_path}`"
        )
    raise ConfigError(f"unknown scenario {name_or_path!r}.{nearest(name_or_path, names)} Or give the path of a .toml file.")


def _override(data: dict[str, Any], settings: Sequence[str]) -> dict[str, str]:
    """Write the settings (texts "table.field=value") into the data of a scenario.

    Returns a dict from each field that was set, as "table.field", to the text that set it. Raises ConfigError.
    """
    origins = {}
    for setting in settings:
        field, equals, value = setting.partition("=")
        *tables, name = field.strip().split(".")
        if not equals or not tables or not name:
            raise ConfigError(f"--set {setting}: write it as table.field=value, for example --set services.model.contact_forces=false")
        table = data
        for depth, key in enumerate(tables):
            if key not in table and depth < 2 and not (depth == 0 and key == "shared"):
                raise ConfigError(f"--set {setting}: the scenario has no {'.'.join(tables[: depth + 1])}.{nearest(key, _tables(table))}")
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                raise ConfigError(f"--set {setting}: {'.'.join(tables[: depth + 1])} is a value, not a table")
        table[name] = _value(value)
        origins[field.strip()] = setting
    return origins


def _tables(table: Mapping[str, Any]) -> list[str]:
    return [key for key, value in table.items() if isinstance(value, dict)]


def _value(text: str) -> Any:
    """Return a value from its TOML text; a word without quotes is a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, RecursionError):
        return text.strip()


def _where_or_shared(file: _File, where: Callable[[str], str]) -> Callable[[str], str]:
    """Return a function like `where`, from a field to its place (file and line), that also knows the table [shared].

    For a field of a service that is set only in [shared], it returns the place of the field in [shared].
    """

    def find(field: str) -> str:
        match field.split(".", 3):
            case ["services", who, name, *_] if name in file.shared and name not in file.services.get(who, {}):
                return where(f"shared.{name}")
        return where(field)

    return find


def _part(who: str, table: dict[str, Any], shared: Mapping[str, Any], where: Callable[[str], str]) -> Part:
    place = f"services.{who}"
    if not re.fullmatch(r"[a-z0-9_]+", who) or who in ("launcher", "router") or who.startswith(HOST_LAUNCHER):
        raise ConfigError(f"{where(place)}: {who!r} is no valid name of a service: use a-z, 0-9 and _, but not launcher or router")
    own = {key: value for key, value in table.items() if key != "module"}
    module = table.get("module")
    if module is not None and not (isinstance(module, str) and re.fullmatch(r"[^.\s]+(\.[^.\s]+)*", module)):
        raise ConfigError(f"{where(f'{place}.module')}: module {module!r} is no name of a module: write it as my_package.my_service")
    entry = entry_of(who, module)
    if entry is None:
        raise ConfigError(f"{where(place)}: unknown service {who!r}.{nearest(who, NAMES)} Another program needs `module = ...`.")
    cls = _config_class(entry, where(place))
    given = {key: value for key, value in [*shared.items(), *entry.given.items()] if key in cls.__struct_fields__} | own
    return Part(who, entry, _with_world(convert(given, cls, where, f"{place}.")), frozenset(given))


def _with_world(config: ServiceConfig) -> ServiceConfig:
    """Return the settings with the world that will be loaded, so that a run's record has it even if the scenario names none."""
    if not isinstance(config, WorldConfig):
        return config
    return structs.replace(config, world=effective_world(config.world, config.robot))


def _for_lockstep(parts: list[Part]) -> list[Part]:
    """Return the services for lockstep: robot_sim gets the list of participants; services that depend on real time are left out."""
    if all(part.who != "robot_sim" or part.config.mode == "free" for part in parts):
        return parts
    kept = [part for part in parts if not part.entry.real_time]
    return [_with_participants(part, kept) if part.who == "robot_sim" and "participants" not in part.given else part for part in kept]


def _with_participants(sim: Part, parts: Sequence[Part]) -> Part:
    who = tuple(part.who for part in parts if part.entry.participates and part.config.namespace == sim.config.namespace)
    return replace(sim, config=structs.replace(sim.config, participants=who))


def _config_class(entry: Entry, where: str) -> type[ServiceConfig]:
    module, _, name = entry.config.partition(":")
    try:
        found = getattr(importlib.import_module(module), name)
    except Exception as error:  # of a user's module, which may fail in any way
        raise ConfigError(f"{where}: cannot import {name} from {module} ({type(error).__name__}: {error})") from None
    if not (isinstance(found, type) and issubclass(found, ServiceConfig)):
        raise ConfigError(f"{where}: {entry.config} is not a subclass of ServiceConfig")
    return found


def _check_shared(shared: Mapping[str, Any], parts: Sequence[Part], where: Callable[[str], str]) -> None:
    known = {field.name for part in parts for field in structs.fields(part.config)}
    for name in shared:
        if name not in known:
            raise ConfigError(f"{where('shared.' + name)}: no service has a field {name!r}.{nearest(name, sorted(known))}")
