"""One trial: a client that insists drives the hand into the table's field, and something steps in, or nothing does."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from experiments.graze.approach import Table, Way
from experiments.graze.client import SPEED, Client
from experiments.graze.truth import Truth
from mobee.control import Controller, Gains, SettleTest
from mobee.control.reflex import Reflex
from mobee.control.reflex_settings import ReflexSettings
from mobee.robot.robot import Array
from mobee.simulation.motors import NOISE_PERIOD, MotorParameters, Motors

DT = 0.01  # s
SECONDS = 12.0
RELAPSE = 0.3  # s after control is back; the way from the start to the contact takes longer
QUICKER_THAN_LIGHT = 1e6  # rad/s: nobody limits the naive reflex
SETTINGS = {"naive": ReflexSettings.naive(), "mended": ReflexSettings()}
VARIANTS = ("off", *SETTINGS, "2.0")


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of one."""

    variant: str
    angle: float  # degrees
    spot: int
    seed: int
    depth: float  # m, deepest that any shape went into the table, of the joints as they are
    solid: float  # m, the same of solids alone
    switches: float  # of control, a second
    flips: float  # changes between free and in contact as the encoders say, a second
    flicker: float  # s, from the first contact to the last free pose, on the way of `off`
    reflexes: int
    again: bool  # the first recovery: contact came back, as the reflex saw it
    came_back: bool  # the same, as it was
    never: bool  # control came back, or never did, while the hand was in contact
    deeper: bool  # the way back went deeper than the stop
    relapse: bool  # the second reflex came as soon as control was back
    settled: bool  # 2.0: the controller says so
    progress: float  # m, from the start to where the hand was farthest along the table

    @property
    def recovered(self) -> bool:
        """1.0: the first recovery took the hand out of contact, and there it was free."""
        return self.reflexes > 0 and not (self.came_back or self.never or self.deeper or self.relapse)

    @property
    def clean(self) -> bool:
        """1.0: besides, nothing was seen of the contact any more on the way back."""
        return self.recovered and not self.again


COLUMNS = tuple(column.name for column in fields(Trial))


def run_trial(table: Table, way: Way, variant: str, angle: float, spot: int, seed: int) -> Trial:
    """12 s of the client's insisting; `angle` in degrees only names the way."""
    client = Client(table.robot, way, DT)
    body = _Body(table, client.start, np.random.default_rng([seed, spot, 0x677A]))
    truth = Truth(table, way)
    if variant == "2.0":
        settled, control = _deflect(table, client, body, truth), Control()
    else:
        settled, control = False, _switch(table, client, body, truth, SETTINGS.get(variant))
    return Trial(
        variant=variant,
        angle=angle,
        spot=spot,
        seed=seed,
        depth=truth.depth,
        solid=truth.solid,
        switches=control.switches / SECONDS,
        flips=truth.flips / SECONDS,
        flicker=truth.flicker * DT if variant == "off" else 0.0,
        reflexes=len(control.taken),
        again=truth.again,
        came_back=truth.came_back,
        never=truth.never,
        deeper=truth.deeper,
        relapse=control.relapsed,
        settled=settled,
        progress=truth.progress,
    )


@dataclass(slots=True)
class Control:
    """When the reflex took control, and when it gave it back; ticks."""

    taken: list[int] = field(default_factory=list)
    given: list[int] = field(default_factory=list)

    @property
    def switches(self) -> int:
        """How often control changed hands."""
        return len(self.taken) + len(self.given)

    @property
    def relapsed(self) -> bool:
        """Whether the second reflex followed at once upon the first."""
        return len(self.taken) > 1 and (self.taken[1] - self.given[0]) * DT <= RELAPSE


class _Body:
    """Motors and encoders; a command acts one tick after it was formed, as live."""

    def __init__(self, table: Table, q: Array, rng: np.random.Generator) -> None:
        parameters = MotorParameters()
        self._motors = Motors(table.robot, parameters, 0, q)
        self._substeps = parameters.substeps(DT)
        self._noise = parameters.encoder_noise * np.sqrt(NOISE_PERIOD / DT)
        self._rng = rng

    @property
    def q(self) -> Array:
        """Where the joints are, (n,) rad."""
        return self._motors.q

    def encoders(self) -> Array:
        """What the encoders say of it."""
        q: Array = self._motors.q + self._noise * self._rng.standard_normal(len(self._motors.q))
        return q

    def tick(self, mode: str, reference: Array) -> None:
        """Run for a tick under the command of the tick before."""
        self._motors.command(slice(None), "velocity" if mode == "velocity" else "position", reference)
        self._motors.move(self._substeps, DT / self._substeps)


def _switch(table: Table, client: Client, body: _Body, truth: Truth, settings: ReflexSettings | None) -> Control:
    """MoBeE 1.0, or nothing: position commands, forwarded or replaced."""
    limit = np.full(len(table.robot.motors), QUICKER_THAN_LIGHT)
    if settings is not None and settings.brake:
        limit = np.array([motor.max_velocity for motor in table.robot.motor_table])
    reflex = Reflex(settings or ReflexSettings(confirm=SECONDS + 1.0), DT, limit)
    track, command, control = table.model.track(), client.start, Control()
    for k in range(round(SECONDS / DT)):
        body.tick("position", command)
        q = body.encoders()
        violations = table.watch.look(track.evaluate(q))
        target = reflex.tick(q, violations)
        truth.look(body.q, bool(violations), reflex)
        if reflex.counts.reflexes > len(control.taken):
            control.taken.append(k)
        if target is not None:
            command = target
            continue
        if len(control.given) < len(control.taken):
            control.given.append(k)
            client.retry(q)
        if client.leaves_start:
            reflex.mark()
        command = client.next()
    truth.finish()
    return control


def _deflect(table: Table, client: Client, body: _Body, truth: Truth) -> bool:
    """MoBeE 2.0: the client's references are attractors; whether the arm settled behind the last one."""
    controller = Controller(table.model, Gains.default(), speed_scale=SPEED)
    controller.reset(client.start)
    track, command = table.model.track(), np.zeros(len(client.start))
    arm = table.robot.part("left_arm").slice
    test, verdict = None, "moving"
    for k in range(round(SECONDS / DT)):
        body.tick("velocity", command)
        q = body.encoders()
        pose = track.evaluate(q)
        controller.attractor = client.next()
        command = controller.step(q, DT, controller.forces(pose)).velocity
        truth.look(body.q, bool(table.watch.look(pose)), None)
        if client.is_over and test is None:
            test = SettleTest(controller.gains.settle, k * DT)
        if test is not None and verdict == "moving":
            verdict = test.look(k * DT, controller.velocity[arm], controller.acceleration[arm])
    return verdict == "settled"
