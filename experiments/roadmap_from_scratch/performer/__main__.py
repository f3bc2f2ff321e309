"""`python -m experiments.roadmap_from_scratch.performer`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bus_schema import keys
from bus_schema.rpc import Done, Empty
from experiments.kit.run_folder import read, write
from experiments.roadmap_from_scratch.live import DONE, JOB
from experiments.roadmap_from_scratch.performer.config import Config
from experiments.roadmap_from_scratch.settings import PART, explorer
from mobee import ActionInterrupted, load_robot
from mobee.roadmap.adaptive.map_store import MapStore
from services.common.bus_plant import BusPlant
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import Service


def main(argv: Sequence[str] | None = None) -> None:
    """Explore, and have the system end."""
    name = "experiments.roadmap_from_scratch.performer"
    config = load_config(Config, argv, name)
    with explained(name):
        robot, folder = load_robot(config.robot), Path(config.run_dir)
        job = read(folder / JOB)
        with Service("performer", config, robot) as service, MapStore(job["store"], PART) as store:
            plant = BusPlant(service, robot, (PART,))
            who = explorer(plant, job["seed"], store)
            service.ready()
            plant.measure(PART)
            finished, most = False, job["most"]
            while not finished and (most is None or who.record.transitions < most):
                try:
                    finished = who.explore(1)
                except ActionInterrupted:
                    continue
            write(folder / DONE, {"finished": finished, "repairs": who.repairs})
            plant.leave()
            service.call(keys.service_rpc("launcher", "shutdown"), Empty, Done, tries=3)
            service.run()


if __name__ == "__main__":
    main()
