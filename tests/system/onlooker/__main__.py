# SPDX-License-Identifier: Apache-2.0
"""`python -m tests.system.onlooker`."""

from __future__ import annotations

import json
from pathlib import Path

from bus_schema import keys
from bus_schema.rpc import Done, MoveObject
from mobee import load_robot
from services.common.bus_plant import BusPlant
from services.common.config import load_config
from services.common.service import Service
from tests.system.onlooker.config import Config
from tests.system.onlooker.script import PART, perform


def main() -> None:
    config = load_config(Config, None, "onlooker")
    robot = load_robot(config.robot)
    with Service("onlooker", config, robot) as service:
        plant = BusPlant(service, robot, (PART,))
        service.ready()

        def move(place: tuple[float, ...]) -> None:
            service.call(keys.world_rpc("move"), MoveObject, Done, tries=3, name="cup", position=list(place))

        found = perform(plant, plant.places, move)
        Path(config.run_dir, "transitions.json").write_text(json.dumps(found))
        plant.leave()
        service.run()


main()
