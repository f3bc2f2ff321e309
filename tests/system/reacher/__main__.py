# SPDX-License-Identifier: Apache-2.0
"""`python -m tests.system.reacher`."""

from __future__ import annotations

import json
from pathlib import Path

from mobee import ReachTarget, load_robot
from services.common.bus_plant import BusPlant
from services.common.config import load_config
from services.common.service import Service
from tests.system.reacher.config import Config
from tests.system.reacher.script import FAR, MARKER, PART, perform


def main() -> None:
    config = load_config(Config, None, "reacher")
    robot = load_robot(config.robot)
    with Service("reacher", config, robot) as service:
        plant = BusPlant(service, robot, (PART,))
        service.ready()
        while config.in_vain:
            plant.present(ReachTarget(FAR))
            plant.reach(PART, MARKER)
        outcomes = list(perform(plant))
        Path(config.run_dir, "reaches.json").write_text(json.dumps(outcomes))
        plant.leave()
        service.run()


main()
