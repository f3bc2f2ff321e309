"""Crossings on the live robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from experiments.kit.live import write_job
from experiments.kit.walking import launch
from experiments.replanning.job import Job
from experiments.replanning.scene import RATE, SIMULATED, SPEED, WORLD

MODULE = "experiments.replanning.performer"
LONGEST = 60.0  # s for a crossing


def perform(folder: Path, job: Job, seed: int, lockstep: bool = False) -> dict[str, Any]:
    """Launch a system that does a job; its record of every tick is left in the folder.  Raises LaunchFailed."""
    write_job(folder, job)
    return launch(
        folder,
        MODULE,
        title="Re-planning",
        world=str(WORLD),
        simulated=str(SIMULATED),
        seed=seed,
        rate=RATE,
        speed=SPEED,
        seconds=LONGEST * (1 + len(job.after)),
        lockstep=lockstep,
    )
