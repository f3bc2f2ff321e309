"""The simulated robot: the motors, and the offline plant that runs them with model and controller in one process."""

from mobee.simulation.motors import MotorParameters as MotorParameters
from mobee.simulation.motors import Motors as Motors
from mobee.simulation.plant import OfflinePlant as OfflinePlant
from mobee.simulation.runner import Trace as Trace
from mobee.simulation.together import advance_together as advance_together
from mobee.simulation.together import run_batch as run_batch
from mobee.simulation.together import run_together as run_together
