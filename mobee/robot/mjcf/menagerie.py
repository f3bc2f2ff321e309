# SPDX-License-Identifier: Apache-2.0
"""Finds robots of MuJoCo Menagerie by name with the package mujoco-menagerie, which downloads a robot at its first use."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path

from mobee.errors import RobotFileError, Simplified

PACKAGE = "mujoco_menagerie"


def menagerie_names() -> tuple[str, ...]:
    """Return the names of the robots of MuJoCo Menagerie; empty if the package mujoco-menagerie is not installed."""
    if importlib.util.find_spec(PACKAGE) is None:
        return ()
    import mujoco_menagerie

    return tuple(mujoco_menagerie.names())


def menagerie_file(name: str) -> Path | None:
    """Return the path of the MJCF file of a robot of MuJoCo Menagerie; download it if necessary, with a warning before.

    The name may omit the maker if it is unambiguous: "panda" is "franka_emika_panda". Returns None if Menagerie has no such robot, or the
    package mujoco-menagerie is not installed. Raises RobotFileError if the download fails.
    """
    names = menagerie_names()
    found = [name] if name in names else [known for known in names if known.endswith(f"_{name}")]
    if len(found) != 1:
        return None
    import mujoco_menagerie

    robot, cache = mujoco_menagerie.get(found[0]), mujoco_menagerie.Cache()
    if cache.root is None and not cache.is_cached(robot):
        size = (robot.download_size or 0) / 1e6
        warnings.warn(f"mujoco-menagerie downloads {found[0]} ({size:.0f} MB) into {cache.dir}", Simplified, stacklevel=4)
    try:
        return Path(robot.xml(robot.default_model))
    except mujoco_menagerie.MenagerieError as error:
        raise RobotFileError(f"{name}: mujoco-menagerie cannot give this robot: {error}. Give the path of a file instead.") from None
