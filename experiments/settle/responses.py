"""The steps of a run: every motor alone, then whole postures one after the other."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from experiments.control.models import icub
from experiments.control.row import Row
from experiments.control.steps import judge, motor_step, step_ride
from mobee import Gains
from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True)
class Response(Row):
    """A row of settle.csv: which step, and what `control.steps.Measured` says of it."""

    gains: str
    period_ms: float
    step: str  # the motor, or "posture 3"
    settling: float
    overshoot: float
    error_deg: float
    rest_deg: float
    is_settled: bool

    @property
    def is_posture(self) -> bool:
        """Whether many motors stepped together."""
        return self.step.startswith("posture ")


def responses(
    gains: str, period_ms: float, motors: Sequence[str] | None, targets: Sequence[Array], seed: int, done: Collection[object]
) -> Iterator[Response]:
    """All steps that are not done yet; motors that the gain set never moves are left out."""
    robot, numbers = icub().robot, Gains.named(gains)
    weight = numbers.weight(robot.motors)

    def respond(step: str, start: Array, end: Array, number: int) -> Response:
        found = judge(step_ride(numbers, period_ms, start, end, seed + number), start, end)
        return Response(gains, period_ms, step, **asdict(found))

    for i, motor in enumerate(robot.motors):
        if weight[i] and (motors is None or motor in motors) and (gains, period_ms, motor) not in done:
            yield respond(motor, *motor_step(i), i)
    before = robot.home
    for number, target in enumerate(targets):
        end = np.where(weight > 0, target, robot.home)
        if (gains, period_ms, f"posture {number}") not in done:
            yield respond(f"posture {number}", before, end, number)
        before = end
