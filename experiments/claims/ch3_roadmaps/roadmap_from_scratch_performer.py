"""Exploration of a map of random poses on the live robot, see `experiments.kit.live.performer`."""

from __future__ import annotations

from pathlib import Path

from experiments.claims.ch3_roadmaps.roadmap_from_scratch_explorer import DONE, JOB, PART, explorer, robot
from experiments.kit.run_folder import read, write
from mobee import ActionInterrupted
from mobee.roadmap.adaptive.record import MapStore
from services.common.bus_plant import BusPlant
from services.common.service import Service


def perform(service: Service, folder: Path) -> None:
    """Explore the map of the job in the folder on the live robot."""
    job = read(folder / JOB)
    with MapStore(job["store"], PART) as store:
        plant = BusPlant(service, robot(), (PART,))
        search = explorer(plant, job["seed"], store)
        service.ready()
        plant.measure(PART)
        finished, most = False, job["most"]
        while not finished and (most is None or search.record.transitions < most):
            try:
                finished = search.explore(1)
            except ActionInterrupted:
                continue
        write(folder / DONE, {"finished": finished, "repairs": search.repairs})
        plant.leave()
