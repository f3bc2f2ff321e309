"""One configuration style: a frozen struct is at once the file's schema, the flags and the help."""

from __future__ import annotations

import difflib
import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec
import tyro
from msgspec import Struct

from services.common.session import DEFAULT_ENDPOINT

_C = TypeVar("_C", bound=Struct)


class ConfigError(Exception):
    """A configuration that cannot be used: file, line, field and the nearest valid name are in the message."""


class ServiceConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every service is told."""

    endpoint: str = DEFAULT_ENDPOINT
    """Where the router listens."""
    robot: str = "icub"
    """Shipped robot, or path to a robot file."""
    seed: int = 0
    """Seed of everything random in this service."""


def load_config(cls: type[_C], argv: Sequence[str] | None, prog: str) -> _C:
    """The struct from its defaults, then `--config FILE` (TOML), then the other flags; exits with 2 on a mistake."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    default = cls()
    try:
        if "--config" in arguments:
            at = arguments.index("--config")
            if at + 1 == len(arguments):
                raise ConfigError("--config needs a file")
            default = read_toml(Path(arguments[at + 1]), cls)
            del arguments[at : at + 2]
        parsed = tyro.cli(cls, default=default, args=arguments, prog=prog)
        return msgspec.convert(msgspec.to_builtins(parsed), cls)  # constructing a struct does not check its bounds
    except (ConfigError, msgspec.ValidationError) as error:
        print(f"{prog}: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def read_toml(path: Path, cls: type[_C]) -> _C:
    """The struct that a TOML file describes; raises ConfigError in one line."""
    try:
        text = path.read_text()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    _check_names(path, text, data, cls, "")
    try:
        return msgspec.convert(data, cls)
    except msgspec.ValidationError as error:
        field = re.search(r"\$\.([\w.]+)", str(error))
        line = _line_of(text, field.group(1).rsplit(".", 1)[-1]) if field else None
        raise ConfigError(f"{path}{f':{line}' if line else ''}: {error}") from None


def _check_names(path: Path, text: str, data: dict[str, Any], cls: type[Struct], prefix: str) -> None:
    hints = get_type_hints(cls)
    for name, value in data.items():
        if name not in hints:
            near = difflib.get_close_matches(name, hints, n=1)
            hint = f" Did you mean {near[0]!r}?" if near else ""
            line = _line_of(text, name)
            where = f"{path}:{line}" if line else str(path)
            raise ConfigError(f"{where}: unknown field {prefix + name!r}.{hint} Valid: {', '.join(hints)}.")
        if isinstance(value, dict):
            _check_table(path, text, value, hints[name], f"{prefix}{name}.")


def _check_table(path: Path, text: str, table: dict[str, Any], hint: Any, prefix: str) -> None:
    """Descend into a struct, or into each value of a dict of structs."""
    if isinstance(hint, type) and issubclass(hint, Struct):
        _check_names(path, text, table, hint, prefix)
        return
    inner = get_args(hint)
    if len(inner) == 2 and isinstance(inner[1], type) and issubclass(inner[1], Struct):
        for key, value in table.items():
            if isinstance(value, dict):
                _check_names(path, text, value, inner[1], f"{prefix}{key}.")


def _line_of(text: str, name: str) -> int | None:
    pattern = re.compile(rf"^\s*(\[.*\b{re.escape(name)}\b.*\]|\"?{re.escape(name)}\"?\s*=)|[{{,]\s*{re.escape(name)}\s*=")
    for number, line in enumerate(text.splitlines(), start=1):
        if pattern.search(line):
            return number
    return None
