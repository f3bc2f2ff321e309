# SPDX-License-Identifier: Apache-2.0
"""Configuration: a frozen struct is the schema of the settings file, the command-line flags and the help."""

from __future__ import annotations

import difflib
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta, Struct

from mobee.errors import InvalidValue
from mobee.model.world import World
from mobee.robot.robot import Robot
from services.common.exit_codes import BAD_INPUT
from services.common.identity import DEFAULT_ENDPOINT
from services.common.session import NAMESPACE
from services.common.worlds import world_around

_C = TypeVar("_C", bound=Struct)
_KEY = re.compile("[a-z0-9_]+")
_TYPE = re.compile("`(\\w+)`")
_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": 'a text in "quotes"',
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}
"""What msgspec's names of types are called in a settings file."""


class ConfigError(Exception):
    """Raised for a configuration that cannot be used; the message has file, line, field and the nearest valid name."""


class ServiceConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of every service."""

    endpoint: str = DEFAULT_ENDPOINT
    """Address of the router."""
    namespace: Annotated[str, Meta(pattern="^[a-z0-9_]+$")] = NAMESPACE
    """Prefix of all keys on the bus: icub for the robot, or the prefix under which the port filter's clients find the robot."""
    robot: str = "icub"
    """Shipped robot, or path to a robot file."""
    seed: Annotated[int, Meta(ge=0)] = 0
    """Seed of all random numbers in this service, 0 or more."""
    mode: Literal["free", "lock"] = "free"
    """free: in real time; lock: in lockstep, where every tick waits for all participants and time runs as fast as they answer."""
    patience: Annotated[float, Meta(ge=2, le=60)] = 2.0
    """Lockstep: s of real time after which a participant without an answer is dropped; raise it on a busy machine."""

    def packages(self) -> Mapping[str, str]:
        """Return the packages that these settings need in addition to those of the service.

        Keys: import names of the packages. Values: the extra of this project that installs the package, such as "sim".
        """
        return {}

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if the service cannot serve the robot with these settings; the message has the reason and a remedy.

        The launcher calls this before it starts any service, and each service calls it before it is ready. Subclasses add their own
        conditions.
        """
        for part in robot.parts:
            if not _KEY.fullmatch(part):
                raise InvalidValue(
                    f"part {part!r} of {robot.name!r} cannot be used live, because its name stands in keys on the bus, which have a-z, 0-9 "
                    "and _ only: rename the part (bodypart of an XML file, group of an SRDF)."
                )


class WorldConfig(ServiceConfig, frozen=True, kw_only=True):
    """Settings of a service that loads a world of its own."""

    world: str = ""
    """Shipped world, path to a world file, or none; empty: the table for the shipped iCubs, none for every other robot."""

    def load_world(self) -> World:
        """Return a new world in its initial state; raises MobeeError for a name or file that cannot be read."""
        return world_around(self.world, self.robot)


def load_config(cls: type[_C], argv: Sequence[str] | None, prog: str) -> _C:
    """Return the settings of a program: the defaults of `cls`, replaced by those in a TOML file (`--config FILE`), then by the other flags.

    `argv`: command line without the program's name; None: that of this process. `prog`: name of the program, for messages. Exits with code
    2 on an error.
    """
    given = sys.argv[1:] if argv is None else argv
    arguments = [piece for word in given for piece in (word.split("=", 1) if word.startswith("--config=") else [word])]
    default = cls()
    try:
        if "--config" in arguments:
            at = arguments.index("--config")
            if at + 1 == len(arguments):
                raise ConfigError("--config needs a file")
            default = read_toml(Path(arguments[at + 1]), cls)
            del arguments[at : at + 2]
        if not arguments:
            return default
        import tyro  # 0.1 s, which a service that is given a file alone does not wait for

        parsed = tyro.cli(
            cls, default=default, args=arguments, prog=prog, description=f"{cls.__doc__}  --config FILE: a TOML file with any of these."
        )
        return msgspec.convert(msgspec.to_builtins(parsed), cls)  # constructing a struct does not check its bounds
    except (ConfigError, msgspec.ValidationError) as error:
        print(f"{prog}: {error}", file=sys.stderr)
        raise SystemExit(BAD_INPUT) from None


def read_toml(path: Path, cls: type[_C]) -> _C:
    """Return the settings in a TOML file as a struct of the type `cls`; raises ConfigError with a message of one line."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not TOML: not UTF-8 at byte {error.start}") from None
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{path}: nested too deeply") from None

    def where(field: str) -> str:
        line = line_of(text, field)
        return f"{path}:{line}" if line else str(path)

    return convert(data, cls, where)


def convert(data: dict[str, Any], cls: type[_C], where: Callable[[str], str], prefix: str = "") -> _C:
    """Return the settings in the dict `data` as a struct of the type `cls`; raises ConfigError, whose message names the field.

    `where(field)`: returns the place of a field for the message, such as "file:line". `prefix`: text before all names of fields in
    messages, such as "shared.".
    """
    check_names(data, cls, where, prefix)
    try:
        return msgspec.convert(data, cls)
    except msgspec.ValidationError as error:
        text, _, place = str(error).partition(" - at `$.")
        text = _TYPE.sub(lambda match: _WORDS.get(match[1], match[0]), text)
        field = prefix + place.rstrip("`")
        raise ConfigError(f"{where(field)}: {field}: {text}.{_nearest_choice(data, cls, place.rstrip('`'))}") from None


def check_names(data: dict[str, Any], cls: type[Struct], where: Callable[[str], str], prefix: str = "") -> None:
    """Raise ConfigError for the first name in `data` that is not a field of the struct `cls`, or of a struct inside it.

    `where(field)`: returns the place of a field for the message, such as "file:line". `prefix`: text before all names of fields in
    messages.
    """
    hints = get_type_hints(cls)
    for name, value in data.items():
        if name not in hints:
            raise ConfigError(f"{where(prefix + name)}: unknown field {prefix + name!r}.{nearest(name, hints)}")
        if isinstance(value, dict):
            _check_table(value, hints[name], where, f"{prefix}{name}.")


def nearest(given: str, valid: Iterable[str]) -> str:
    """Return the end of a message about the unknown name `given`: the most similar valid name, and all valid names."""
    names = list(valid)
    near = difflib.get_close_matches(given, names, n=1)
    return f"{f' Did you mean {near[0]!r}?' if near else ''} Valid: {', '.join(names) or 'none'}."


def line_of(text: str, field: str) -> int | None:
    """Return the number of the line in a TOML text that sets `field`, which is given as "table.field"; the first line is 1.

    If no line sets the field, the result is the line of the innermost table around it, or None without such a table.
    """
    field = field.partition("[")[0]  # msgspec does not say which entry of a table or list
    table, closest, found = "", -1, None
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r'\[+([\w."-]+)\]+\s*(#.*)?$', line):
            name = table = header.group(1).replace('"', "")
        elif key := re.match(r'\s*([\w."-]+)\s*=', line):
            name = f"{table}.{key.group(1)}".lstrip(".").replace('"', "")
        else:
            continue
        if f"{field}.".startswith(f"{name}.") and len(name) > closest:
            closest, found = len(name), number
    return found


def _check_table(table: dict[str, Any], hint: Any, where: Callable[[str], str], prefix: str) -> None:
    """Check the names in a table that is a struct, or in each value of a dict of structs."""
    if isinstance(hint, type) and issubclass(hint, Struct):
        check_names(table, hint, where, prefix)
        return
    inner = get_args(hint)
    if len(inner) == 2 and isinstance(inner[1], type) and issubclass(inner[1], Struct):
        for key, value in table.items():
            if isinstance(value, dict):
                check_names(value, inner[1], where, f"{prefix}{key}.")


def _nearest_choice(data: dict[str, Any], cls: type[Struct], field: str) -> str:
    """Return the nearest valid word for a field that accepts only a few words."""
    hint, given = get_type_hints(cls).get(field), data.get(field)
    if get_origin(hint) is Literal and isinstance(given, str):
        return nearest(given, map(str, get_args(hint)))
    return ""
