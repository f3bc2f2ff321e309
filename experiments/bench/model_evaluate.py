"""How long one evaluation of the egocentric model takes: the iCub at the table, medians over random poses, in microseconds.

Claim (thesis 2.3): the model is fast enough for reactive control at 100 Hz.  Run time: a few seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import mobee

POSES, SEED = 300, 0


def median_us(function: Callable[[int], object]) -> float:
    """Median time of function(0) .. function(POSES - 1) in us."""
    times = []
    for i in range(POSES):
        start = time.perf_counter()
        function(i)
        times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1e6


def main() -> None:
    """Print the medians."""
    robot = mobee.load_robot("icub")
    world = mobee.load_world("table")
    model = mobee.Model(robot, world)
    rng = np.random.default_rng(SEED)
    low, high = robot.limits.T
    near = robot.home + 0.05 * rng.normal(size=(POSES, len(low)))
    anywhere = rng.uniform(low, high, (POSES, len(low)))
    print(f"kinematics only       {median_us(lambda i: model.evaluate(anywhere[i])):6.0f} us")
    print(f"contacts, near home   {median_us(lambda i: model.evaluate(near[i]).contacts):6.0f} us")
    print(f"contacts, random pose {median_us(lambda i: model.evaluate(anywhere[i]).contacts):6.0f} us")
    print(f"jacobian of a marker  {median_us(lambda i: model.jacobian(near[i], 'left_palm')):6.0f} us")


if __name__ == "__main__":
    main()
