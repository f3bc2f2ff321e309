# SPDX-License-Identifier: Apache-2.0
"""Creates the folder of a run with its scenario, settings, versions and logs, and writes settings as TOML."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from msgspec import structs, to_builtins

from services.common.config import ServiceConfig
from services.common.emergency_stop import StopRecord, datagram_address
from services.common.worlds import is_path
from services.launcher.scenario import FILES, Scenario

_PACKAGES = ("mobee", "eclipse-zenoh", "msgspec", "numpy", "pybullet", "mujoco-core", "icub-models", "rerun-sdk")


def make_run_directory(runs: Path, scenario: Scenario, endpoint: str, routes: bool = True) -> Path:
    """Create the folder `runs/<time>-<name>/` of a run, and return its path.

    It contains scenario.toml, versions.toml, the settings of each service (<name of the service>.toml), and the folder logs/. `endpoint`:
    address of the router, written into the settings. `routes`: whether the router is on this host. Raises OSError if the folder cannot be
    written.
    """
    directory = _new_folder(runs, f"{time.strftime('%Y%m%d-%H%M%S')}-{scenario.name}")
    (directory / "logs").mkdir()
    address = datagram_address(endpoint) if routes else ""
    configs = {part.who: _complete(part.config, part.given, endpoint, directory, address) for part in scenario.parts}
    for who, config in configs.items():
        (directory / f"{who}.toml").write_text(to_toml(to_builtins(config)))
    (directory / "scenario.toml").write_text(to_toml(scenario.as_tables(configs)))
    (directory / "versions.toml").write_text(to_toml(_versions()))
    return directory


def _new_folder(runs: Path, name: str) -> Path:
    """Make a folder for a run and return it; a second run in the same second gets a folder with a number."""
    runs.mkdir(parents=True, exist_ok=True)
    for number in range(1, 100):
        folder = runs / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir(mode=0o700)  # it holds the recording of all messages, and the key of the page
        except FileExistsError:
            continue
        return folder.resolve()
    raise FileExistsError(f"too many runs named {name}")


def _complete(config: ServiceConfig, given: frozenset[str], endpoint: str, directory: Path, stop_address: str) -> ServiceConfig:
    """Return a service's settings with the endpoint, absolute paths of the files that it reads, the run's directory, and how to stop it."""
    named = {field: getattr(config, field, "") for field in FILES}
    files = {field: str(Path(name).resolve()) for field, name in named.items() if is_path(name)}
    config = structs.replace(config, endpoint=endpoint, **files)
    if "run_dir" in config.__struct_fields__ and "run_dir" not in given:
        config = structs.replace(config, run_dir=str(directory))
    if "stop_record" in config.__struct_fields__ and "stop_record" not in given:
        config = structs.replace(config, stop_record=str(StopRecord.of_endpoint(endpoint).path))
    if "stop_address" in config.__struct_fields__ and "stop_address" not in given:
        config = structs.replace(config, stop_address=stop_address)
    return config


def _versions() -> Mapping[str, object]:
    found = {}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return {"python": platform.python_version(), "platform": platform.platform(), "packages": found}


def to_toml(tables: Mapping[str, Any], prefix: str = "") -> str:
    """Return nested tables as TOML text, from which `tomllib` reads the same tables.

    Values of None are left out. `prefix`: name of the table that contains them.
    """
    plain = {key: value for key, value in tables.items() if value is not None and not isinstance(value, Mapping)}
    nested = {key: value for key, value in tables.items() if isinstance(value, Mapping)}
    lines = [f"{_key(key)} = {_value(value)}\n" for key, value in plain.items()]
    header = f"[{prefix}]\n" if prefix and (plain or not nested) else ""
    parts = [header + "".join(lines)]
    parts += [to_toml(value, f"{prefix}.{_key(key)}".lstrip(".")) for key, value in nested.items()]
    return "\n".join(part for part in parts if part)


def _key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    return repr(value)
