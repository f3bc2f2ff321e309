"""The map of a seed, explored by the real processes in lockstep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from experiments.babbling.contacts import read_touches
from experiments.babbling.measured import CONTACTS, POSITIONS
from experiments.kit.run_folder import read, write
from experiments.kit.walking import launch
from experiments.roadmap_from_scratch.settings import PART, RATE, SPEED, WORLD, offline_plant, robot
from experiments.roadmap_from_scratch.settings import explorer as made
from experiments.roadmap_from_scratch.trial import agreement, outcome
from mobee.roadmap.adaptive.map_store import MapStore

MODULE = "experiments.roadmap_from_scratch.performer"
JOB, DONE, STORE = "job.json", "done.json", "map.sqlite"
LONGEST = 8 * 3600.0  # s of robot time


def finish(folder: Path, seed: int, most: int | None) -> None:
    """Explore, or go on: what was seen is in the store, and each launch leaves its record in a folder of its own."""
    folder.mkdir(exist_ok=True)
    if (folder / DONE).exists():
        return
    number = len(list(folder.glob("launch-*")))
    place = folder / f"launch-{number:03}"
    place.mkdir()
    write(place / JOB, {"seed": seed, "most": most, "store": str((folder / STORE).resolve())})
    summary = launch(place, MODULE, title="Roadmap from scratch", world=str(WORLD), seed=seed, rate=RATE, speed=SPEED, seconds=LONGEST)
    told = read(place / DONE)
    write(folder / DONE, {**told, "seed": seed, "repeatable": summary["lockstep"]["repeatable"]})


def read_live(folder: Path) -> dict[str, Any] | None:
    """What came of it, None if it was not run to its end."""
    if not (folder / DONE).exists():
        return None
    told = read(folder / DONE)
    with MapStore(folder / STORE, PART) as store:
        who = made(offline_plant(told["seed"]), told["seed"], store)
    places = sorted(folder.glob("launch-*"))
    row = 8 * len(robot().motors)
    ticks = sum((place / POSITIONS).stat().st_size // row for place in places if (place / POSITIONS).exists())
    touches = [touch for place in places if (place / CONTACTS).exists() for touch in read_touches(place / CONTACTS, 1.0 / RATE)]
    worst = max(touches, key=lambda touch: touch.depth, default=None)
    found = outcome(who.roadmap, told["repairs"]) | {"finished": told["finished"], "hours": ticks / RATE / 3600.0, "touches": len(touches)}
    found |= {"deepest": 0.0 if worst is None else worst.depth, "pair": "" if worst is None else worst.pair}
    return found | {"agree": agreement(who.roadmap, told["seed"] + 1000), "edges": int(np.sum(who.roadmap.beliefs.tried > 0))}
