# SPDX-License-Identifier: Apache-2.0
"""The simulated robot: its motors, and the offline plant, which runs motors, model and controller in one process."""

from mobee.simulation.batch import PlantBatch as PlantBatch
from mobee.simulation.batch import advance_together as advance_together
from mobee.simulation.batch import run_batch as run_batch
from mobee.simulation.batch import run_together as run_together
from mobee.simulation.motors import MotorParameters as MotorParameters
from mobee.simulation.motors import Motors as Motors
from mobee.simulation.plant import OfflinePlant as OfflinePlant
from mobee.simulation.plant import PlantSettings as PlantSettings
from mobee.simulation.runner import Trace as Trace
from mobee.simulation.sliding import SlidingObject as SlidingObject
