# SPDX-License-Identifier: Apache-2.0
"""The files of a setup: robot, scenario, transitions, and a README that explains them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobee.errors import InvalidValue
from mobee.robot.xml.write import write_xml
from mobee_cli.errors import UserError
from mobee_cli.playing.setup import Setup
from services.common.exit_codes import FAILED
from services.common.worlds import NO_WORLD, is_path
from services.launcher.run_directory import to_toml

README = "README.md"


@dataclass(frozen=True, slots=True)
class Files:
    """The files beside each other in a folder: NAME.xml, NAME.toml and NAME.sqlite."""

    store: Path

    @property
    def robot(self) -> Path:
        """The robot as it was derived, as zero-position XML; there is none for a shipped robot."""
        return self.store.with_suffix(".xml")

    @property
    def scenario(self) -> Path:
        """The scenario in which the agents continue live from the transitions in the store."""
        return self.store.with_suffix(".toml")


def write_files(setup: Setup, files: Files) -> None:
    """Write robot and scenario; raises UserError if a file cannot be written, InvalidValue for a robot that a file cannot hold."""
    try:
        files.store.parent.mkdir(parents=True, exist_ok=True)
        if not setup.shipped:
            write_xml(setup.robot, files.robot)
        files.scenario.write_text(_scenario(setup, files), encoding="utf-8")
    except OSError as error:
        raise UserError(f"{error.filename or files.store.parent} cannot be written ({error.strerror})", FAILED) from error


def _scenario(setup: Setup, files: Files) -> str:
    shared: dict[str, Any] = {"robot": setup.shipped or files.robot.name, "gains": setup.gains}
    if setup.world != NO_WORLD:
        shared["world"] = str(Path(setup.world).resolve()) if is_path(setup.world) else setup.world
    if setup.cameras:
        shared["cameras"] = list(setup.cameras)
    services: dict[str, Any] = {"robot_sim": {}, "model": {}, "controller": {}}
    for part, config in setup.agents.items():
        own = {"joints": list(config.joints), "neighbours": config.neighbours, "rest": list(config.rest)}
        settings = {name: value for name, value in own.items() if value}
        services[f"agent_{part}"] = settings | {"explorer": config.curious().explorer, "seed": config.seed, "continues": files.store.name}
    services |= {who: {} for who in setup.eyes}
    services["monitor"] = {}
    tables = {"title": f"A curious {setup.name}", "shared": shared, "services": services}
    return f"# Written by mobee: the agents continue from their offline transitions, in {files.store.name}.\n{to_toml(tables)}"


def write_readme(setup: Setup, files: Files) -> None:
    """Write a README that says what each file is for and what to edit."""
    robot, scenario, store = (path.name for path in (files.robot, files.scenario, files.store))
    own = f"- `{robot}`: the robot. Edit parts, limits, home, fields and pairs, then run `mobee check {robot}`.\n"
    derived = "\n".join(setup.lines)
    text = f"""# {setup.name}

{"" if setup.shipped else own}- `{scenario}`: services, agents and their joints: `mobee launch {scenario}`.
- `{store}`: the transitions: `mobee plan --run {store} --agent PART --to STATE`.

An agent continues only with the joints, limits and settings with which it began. After a change of these remove
`{store}`, and the lines `continues` of the scenario.

What was derived:

```
{derived}
```
"""
    files.store.with_name(README).write_text(text, encoding="utf-8")


def remove_files(files: Files) -> None:
    """Remove what `write_files` and `write_readme` have written, and their folder if nothing else is in it."""
    for path in (files.robot, files.scenario, files.store.with_name(README)):
        path.unlink(missing_ok=True)
    with suppress(OSError):  # it is not empty
        files.store.parent.rmdir()


def free_folder(runs: Path, name: str) -> Path:
    """Return a folder in `runs` that does not exist yet."""
    for number in range(1, 1000):
        folder = runs / (name if number == 1 else f"{name}-{number}")
        if not folder.exists():
            return folder
    raise InvalidValue(f"{runs} has too many folders called {name}: choose another with --save DIR.")
