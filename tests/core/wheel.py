"""Try an installed MoBeE, outside of a checkout: `python wheel.py`, with the Python it is installed for.

It needs NumPy and what mobee imports, no test tools: it asks each build of the core that this machine runs for contacts and a step
of the controller, and ends with an error if they differ.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

ASK = """
import time
start = time.perf_counter()
import numpy as np
import mobee
robot = mobee.load_robot("icub")
model = mobee.Model(robot, mobee.load_world("table"))
pose = model.evaluate(robot.home + 0.2)
controller = mobee.Controller(model)
controller.attractor = robot.home + 0.3
command = controller.step(robot.home, dt=0.01)
print(pose.count, [c.depth.hex() for c in pose.contacts], [float(v).hex() for v in command.position])
import sys
print(f"{time.perf_counter() - start:.2f} s to here", file=sys.stderr)
"""


def main() -> None:
    """Ask all builds."""
    from mobee._core import levels

    possible = levels.possible_levels(levels.processor_flags())
    answers = {}
    for level in possible:
        environment = {**os.environ, "MOBEE_CORE": level}
        answers[level] = subprocess.run([sys.executable, "-c", ASK], env=environment, stdout=subprocess.PIPE, check=True, text=True).stdout
    if len(set(answers.values())) != 1:
        sys.exit(f"builds differ: {answers}")
    print(f"Python {sys.version.split()[0]}: {', '.join(possible)} agree: {answers[possible[0]].split()[0]} contacts")


if __name__ == "__main__":
    started = time.monotonic()
    main()
    print(f"{time.monotonic() - started:.1f} s")
