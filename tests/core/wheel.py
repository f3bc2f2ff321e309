# SPDX-License-Identifier: Apache-2.0
"""Check an installed MoBeE, outside of a clone: `python wheel.py`, with the Python of that installation.

It needs only the library and its dependencies.  Each build of the core that this machine can run computes contacts and a step of the
controller; the program ends with an error if their results differ.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

PROGRAM = """
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
    """Compare all builds."""
    from mobee._core import levels

    possible = levels.possible_levels(levels.processor_flags())
    answers = {}
    for level in possible:
        environment = {**os.environ, "MOBEE_CORE": level}
        answers[level] = subprocess.run(
            [sys.executable, "-c", PROGRAM], env=environment, stdout=subprocess.PIPE, check=True, text=True
        ).stdout
    if len(set(answers.values())) != 1:
        sys.exit(f"builds differ: {answers}")
    print(f"Python {sys.version.split()[0]}: {', '.join(possible)} agree: {answers[possible[0]].split()[0]} contacts")


if __name__ == "__main__":
    started = time.monotonic()
    main()
    print(f"{time.monotonic() - started:.1f} s")
