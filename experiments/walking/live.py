"""A service that walks on a map, on the live robot with PyBullet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from experiments.kit.live import summary_of

PATIENCE = 60.0  # s for a tick of lockstep: a way is looked for in one

_SCENARIO = """# Written by an experiment of thesis 4.3.
title = "{title}"

[shared]
robot = "icub"
gains = "default"
seed = {seed}
{mode}

[services.robot_sim]
world = "{simulated}"
rate = {rate:g}
record = "{folder}"

[services.model]
world = "{world}"

[services.controller]
speed_scale = {speed:g}

[services.{who}]
module = "{module}"
run_dir = "{folder}"
"""


def launch(
    folder: Path,
    who: str,
    module: str,
    *,
    title: str,
    world: str,
    seed: int,
    rate: float,
    speed: float,
    seconds: float,
    lockstep: bool = True,
    simulated: str = "",
) -> dict[str, Any]:
    """Launch the system with that service, which ends it; its record is left in the folder, and its summary returned.

    `rate`: Hz; `speed`: share of the motors' speed; `seconds`: of robot time, after which it is ended; `simulated`: the simulator's world
    where it is not the model's.  Raises LaunchFailed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mode = f'mode = "lock"\npatience = {PATIENCE:g}' if lockstep else ""
    scenario = folder / "scenario.toml"
    told: dict[str, Any] = {"title": title, "world": world, "simulated": simulated or world, "seed": seed, "mode": mode}
    told |= {"rate": rate, "speed": speed, "who": who, "module": module}
    scenario.write_text(_SCENARIO.format(folder=folder.resolve(), **told))
    limit: dict[str, Any] = {"ticks": round(seconds * rate)} if lockstep else {"duration": seconds}
    return summary_of(str(scenario), runs=folder / "launch", **limit)
