"""Launches the live robot with PyBullet and a performer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from experiments.kit.live import summary_of

PATIENCE = 60.0  # s for a tick of lockstep: the performer plans in one

_SCENARIO = """# Written by an experiment.
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

[services.performer]
module = "experiments.kit.performer"
perform = "{perform}"
run_dir = "{folder}"
"""


def launch(
    folder: Path,
    perform: str,
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
    """Launch the system with a performer; its recording is left in the folder, and its summary returned.

    `perform`: the performer's function, see `Config`; `rate`: Hz; `speed`: share of the motors' speed; `seconds`: of robot time,
    after which the system ends; `simulated`: the simulator's world where it is not the model's.  Raises LaunchFailed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mode = f'mode = "lock"\npatience = {PATIENCE:g}' if lockstep else ""
    scenario = folder / "scenario.toml"
    values: dict[str, Any] = {"title": title, "world": world, "simulated": simulated or world, "seed": seed, "mode": mode}
    values |= {"rate": rate, "speed": speed, "perform": perform}
    scenario.write_text(_SCENARIO.format(folder=folder.resolve(), **values))
    limit: dict[str, Any] = {"ticks": round(seconds * rate)} if lockstep else {"duration": seconds}
    return summary_of(str(scenario), runs=folder / "launch", **limit)
