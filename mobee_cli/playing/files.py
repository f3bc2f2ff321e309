# SPDX-License-Identifier: Apache-2.0
"""The files of a setup (a robot with its agents): robot, scenario, transitions, and a README that explains them."""

from __future__ import annotations

import os
import tempfile
import tomllib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobee.errors import InvalidValue
from mobee.model.world import World
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.xml.write import write_xml
from mobee.simulation.record import described
from mobee_cli.errors import UserError
from mobee_cli.playing.setup import Setup
from services.common.exit_codes import BAD_INPUT, FAILED
from services.common.worlds import NO_WORLD, is_path
from services.launcher.run_directory import to_toml

README = "README.md"


@dataclass(frozen=True, slots=True)
class Files:
    """The paths of the files of a setup (a robot with its agents), in one folder: NAME.xml, NAME.toml and NAME.sqlite.

    `store`: path of NAME.sqlite, the file of the transitions.
    """

    store: Path

    @property
    def robot(self) -> Path:
        """The path of the robot file with the parts that were derived for the agents, in zero-position XML (mobee's own format).

        For a shipped robot this file is not written.
        """
        return self.store.with_suffix(".xml")

    @property
    def scenario(self) -> Path:
        """The path of the scenario (a TOML file with the services to start).

        In the scenario the agents continue to learn live, beginning with the transitions in `store`.
        """
        return self.store.with_suffix(".toml")

    @property
    def readme(self) -> Path:
        """The path of the README.md of the folder, which explains the files; only `mobee play` writes it."""
        return self.store.with_name(README)

    def require_absent(self) -> None:
        """Raise UserError if one of the files exists, or a README.md in their folder: `mobee play` would replace it."""
        for path in (self.robot, self.store, self.readme):
            if os.path.lexists(path):
                raise UserError(f"{path} exists and would be replaced: save into another folder", BAD_INPUT)


def robot_as_written(setup: Setup) -> Robot:
    """Return the robot of a setup as the live system will load it, by its shipped name or from the file that `write_files` writes.

    No file remains. Raises InvalidValue if the robot has properties that its file cannot express.
    """
    if setup.shipped:
        return load_robot(setup.shipped)
    with tempfile.TemporaryDirectory(prefix="mobee-robot-") as folder:
        return load_robot(write_xml(setup.robot, Path(folder) / "robot.xml"))


def require_same_robot(robot: Robot, files: Files) -> None:
    """Raise InvalidValue if the robot file in `files` exists and has another robot: the agents would learn on one and run live on another.

    `robot`: the robot on which the agents learn. Visuals and cameras may differ. Raises MobeeError if the file cannot be read.
    """
    if files.robot.exists() and described(load_robot(files.robot), World()) != described(robot, World()):
        raise InvalidValue(
            f"{files.robot} has another robot than this command learns with: it was edited, or an option such as --part differs. Give the "
            "options of before, or another --store; to learn with the edited robot, give it as --robot, with another --store."
        )


def is_edited(setup: Setup, files: Files) -> bool:
    """Return whether the scenario in `files` exists and says something else than what `write_files` would write for this setup."""
    try:
        return tomllib.loads(files.scenario.read_text("utf-8")) != tomllib.loads(_scenario(setup, files))
    except FileNotFoundError:
        return False
    except (OSError, ValueError, RecursionError):  # TOMLDecodeError and UnicodeDecodeError are ValueErrors
        return True


def write_files(setup: Setup, files: Files) -> None:
    """Write the robot (unless it is a shipped one) and the scenario (services to start) of a setup to their paths in `files`.

    Files that exist are kept. Raises UserError if a file cannot be written, InvalidValue if the robot has properties that its file cannot
    express.
    """
    try:
        files.store.parent.mkdir(parents=True, exist_ok=True)
        if not setup.shipped and not files.robot.exists():
            write_xml(setup.robot, files.robot)
        if not files.scenario.exists():
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
    """Write README.md into the folder of the files of a setup (a robot with its agents).

    It explains the purpose of each file, what the user can edit, and what was derived for the agents.
    """
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
    files.readme.write_text(text, encoding="utf-8")


def remove_files(files: Files) -> None:
    """Remove the files that `write_files` and `write_readme` have written, and their folder if it is then empty.

    Before these functions wrote, none of the files may have existed.
    """
    for path in (files.robot, files.scenario, files.readme):
        path.unlink(missing_ok=True)
    with suppress(OSError):  # it is not empty
        files.store.parent.rmdir()


def free_folder(runs: Path, name: str) -> Path:
    """Return the path of a folder in `runs` that does not exist yet: `name`, or `name` with a number.

    Raises InvalidValue if there are already 999.
    """
    for number in range(1, 1000):
        folder = runs / (name if number == 1 else f"{name}-{number}")
        if not folder.exists():
            return folder
    raise InvalidValue(f"{runs} has too many folders called {name}: choose another with --save DIR.")
