# SPDX-License-Identifier: Apache-2.0
"""The offline plant: model, controller and motors in one process, with the same ticks as the live system (processes on a message bus)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, checked_count, is_number, real_array
from mobee.control import Controller, Gains
from mobee.control.forces import Propagate, Term
from mobee.control.law import Modality
from mobee.errors import ActionInterrupted, InvalidValue, MobeeError
from mobee.model.contact import links_moved, touched_in
from mobee.model.model import engine_of
from mobee.plant import Outcome
from mobee.reach import ReachOutcome, ReachTarget
from mobee.settings import Settings, accepts
from mobee.simulation.actions import Actions, ReachesUnderWay
from mobee.simulation.motors import MotorParameters, Motors
from mobee.simulation.record import described
from mobee.simulation.rigid import living, without_pairs
from mobee.simulation.runner import Runner, Trace, Work, finished

if TYPE_CHECKING:
    from mobee.model.model import Model
    from mobee.model.pose import Pose

CHUNK = 1000  # ticks between two moments at which a run can be interrupted
_RECORDED = ("gains", "motors", "dt", "propagate", "modality", "speed_scale", "contact_forces", "command_age")


@dataclass(frozen=True, kw_only=True)
class PlantSettings(Settings):
    """Settings of an `OfflinePlant`.

    Args:
        gains: gains of the control law; None: `Gains.default()`.
        motors: parameters of the motors; None: `MotorParameters()`, whose defaults reproduce the findings of the thesis and its papers.
        dt: s, the control tick.
        propagate: which motors a contact force acts on: "tree": those of the whole chain from the touching link to the base; "part": those
            of the touching part only.
        modality: kind of the commands: "velocity", "position" or "torque".
        speed_scale: share of the motors' largest speed that is used, above 0, at most 1.
        contact_forces: whether the law has repulsive forces from contacts of fields (larger volumes around the solids); False: the contact
            force f_coll is zero.
        active: names or patterns of parts and motors that move; None: all.  The others are rigid at home, without noise, and need no
            computing time.
        command_age: delay of the commands, in ticks: in tick k the motors move by the command that was computed from the encoders of tick
            k - `command_age`; the live system (processes on a message bus) has 1.
        hashed: whether a hash of all encoder values is computed (`OfflinePlant.hash`).
        terms: further forces of the law, as Python functions, which are called in every tick.
    """

    gains: Gains | None = None
    motors: MotorParameters | None = None
    dt: float = 0.01
    propagate: Propagate = "tree"
    modality: Modality = "velocity"
    speed_scale: float = 1.0
    contact_forces: bool = True
    active: Sequence[str] | None = None
    command_age: int = 1
    hashed: bool = False
    terms: Sequence[Term] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.command_age, bool) or not isinstance(self.command_age, int) or self.command_age < 1:
            raise InvalidValue(f"command_age {self.command_age!r}: must be a whole number of ticks, at least 1")
        if not isinstance(self.motors, MotorParameters | None):
            raise InvalidValue(f"motors is {self.motors!r}; it must be MotorParameters, as MotorParameters.identified(name), or None.")


class OfflinePlant:
    """A simulated robot under the control law, in one process, which does not run in real time; the seed determines all noise.

    It is a Plant (`mobee.plant.Plant`) on which agents can act. With the default `command_age`, a command computed from the encoders of
    tick k moves the motors from tick k + 1 on, as in the live system (processes on a message bus). Several parts may act at once: `begin`
    starts an action, `advance` runs until at least one action has ended, `act` does both for one part. Parts that are not acting are
    controlled too, and stay at their attractors (the positions to which the springs of the control law pull the motors).

    Args:
        model: the robot in its world.
        seed: seed of the encoders' noise, a whole number, at least 0.
        gains: gains of the control law; None: as in `settings`.
        motors: parameters of the motors; None: as in `settings`.
        dt: s, the control tick; None: as in `settings`.
        settings: all settings of the plant; None: the defaults of `PlantSettings`.
        **changes: fields of `PlantSettings` by keyword, in place of those in `settings`.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    @accepts(PlantSettings)
    def __init__(
        self,
        model: Model,
        seed: int = 0,
        gains: Gains | None = None,
        motors: MotorParameters | None = None,
        dt: float | None = None,
        *,
        settings: PlantSettings | None = None,
        **changes: Any,
    ) -> None:
        changes |= {name: value for name, value in (("gains", gains), ("motors", motors), ("dt", dt)) if value is not None}
        chosen = PlantSettings.made(settings, changes)
        alive, dt = living(model.robot, chosen.active), chosen.dt
        law = {name: getattr(chosen, name) for name in ("modality", "propagate", "speed_scale", "contact_forces", "terms")}
        self._controller = Controller(model, chosen.gains, alive=alive, **law)
        if not (is_number(dt) and 0 < dt < self.controller.max_dt):
            raise InvalidValue(f"tick of {dt!r} s: the gains need more than 0 and less than {self.controller.max_dt:.4g} s")
        self.model, self.robot, self.dt = model, model.robot, float(dt)
        parameters = chosen.motors if chosen.motors is not None else MotorParameters()
        self.motors = Motors(self.robot, parameters, seed, self.robot.home, alive)
        self._options = {name: getattr(chosen, name) for name in _RECORDED}
        self._options |= {"gains": self.controller.gains, "motors": parameters}
        if chosen.terms:  # the record of a plant without them stays as it was before there were any
            self._options["terms"] = [term.name for term in chosen.terms]
        self._actions = Actions(self.robot, alive)
        self._touching, self._moved = engine_of(without_pairs(self.robot)), links_moved(self.robot)
        self._runner = Runner(self._controller, self.motors, alive, self.dt, chosen.command_age, self._actions.parts)
        self._alive = alive
        self._pose: Pose | None = None
        self._hashed = chosen.hashed
        self._digest = hashlib.sha256() if chosen.hashed else None
        self._reaches = ReachesUnderWay(model, self._controller)
        self._acting = 0  # number of acting parts when the ticks began
        self._period = 0  # ticks
        self._callback: Callable[[float], None] | None = None

    def __reduce__(self) -> NoReturn:
        """Raise MobeeError: a copy (`copy.copy`, pickle) would share its state, which the compiled core changes, with the original."""
        raise MobeeError("a plant cannot be copied or pickled: the core holds its state. Make a new one, as OfflinePlant(model, seed).")

    def restart(self, seed: int, q: ArrayLike | None = None) -> None:
        """Start again at rest and at time 0; afterwards the plant behaves exactly like a new plant with this seed, but this call is faster.

        Actions and reaches end without an outcome, and forces that were set are removed. The world, a presented target and a callback of
        `every` stay.

        Args:
            seed: seed of the encoders' noise, a whole number, at least 0.
            q: (n,) rad, start posture within the motors' limits; motors that are not active must be at home.  None: home.

        Raises:
            InvalidValue: the seed or the start posture is not valid.
        """
        start = self._checked_start(q)
        self.motors.restart(seed, start)
        self._reaches.restart()
        for part in (None, *self.robot.parts):
            self._controller.end_reach(part)
        self._actions.end_all()
        self._controller.clear()
        self._controller.reset(start)
        self._runner.restart(start)
        self._pose = None
        self._digest = hashlib.sha256() if self._hashed else None

    def _checked_start(self, q: ArrayLike | None) -> Array:
        home = self.robot.home
        if q is None:
            return home.copy()
        start, (low, high) = real_array("start", q), self.robot.limits.T
        if start.shape != home.shape:
            raise InvalidValue(f"start of shape {start.shape}: must be ({len(home)},), a position for every motor of {self.robot.name}")
        wrong = ~((start >= low) & (start <= high)) | (~self._alive & (start != home))
        if wrong.any():
            motor = int(wrong.argmax())
            valid = (
                f"within {low[motor]:.4g} to {high[motor]:.4g} rad" if self._alive[motor] else f"{home[motor]:.4g} rad, as it is not active"
            )
            raise InvalidValue(f"start {start[motor]:.4g} rad of {self.robot.motors[motor]}: must be {valid}")
        return start

    @property
    def controller(self) -> Controller:
        """The controller of the robot; attractors (positions to which springs pull the motors) and forces may be set between ticks."""
        return self._controller

    @property
    def time(self) -> float:
        """The plant's clock: simulated time since its creation or its last restart, s."""
        return self._runner.ticks * self.dt

    @property
    def pose(self) -> Pose | None:
        """The robot's pose at the encoder values of the last tick, with its contacts; None before the first tick.

        The contacts are those in the world at the time when this property is first read after the tick.
        """
        if self._pose is None and self._runner.ticks:
            self._pose = self.model.evaluate(self.q, reaching=self.reaching)
        return self._pose

    @property
    def reaching(self) -> tuple[str, ...]:
        """The names of the markers that a force pulls to the target at present, and, during a call of `act`, of its argument `reaching`.

        The targets exert no repulsive force on the hands that carry these markers.
        """
        return self._reaches.reaching

    @property
    def acting(self) -> tuple[str, ...]:
        """The names of the parts whose action has not ended yet, in the robot's order."""
        return self._actions.under_way

    @property
    def may_edit(self) -> bool:
        """Whether ticks of this plant can change the world, or the markers whose hands the targets do not repel (`reaching`).

        This is possible while a reach is in progress, or while a callback of `every` is set.
        """
        return bool(self._reaches.running) or self._callback is not None

    @property
    def settings(self) -> dict[str, Any]:
        """A record of the robot, its current world and the settings without the seed, as plain JSON values."""
        active = [name for name, alive in zip(self.robot.motors, self._alive, strict=True) if alive]
        return described(self.robot, self.model.world, active=active, **self._options)

    @property
    def hash(self) -> str:
        """The SHA-256 (64 hex digits) of the encoder values (n,) of all ticks so far, as little-endian float64.

        Raises InvalidValue unless the setting `hashed` is True.
        """
        if self._digest is None:
            raise InvalidValue("this plant keeps no hash: make it with hashed=True")
        return self._digest.hexdigest()

    @property
    def q(self) -> Array:
        """The encoder values of all motors at the last tick, (n,) rad; before the first tick, the start posture without noise."""
        return self._runner.q.copy()

    def measure(self, part: str) -> Array:
        """Return the encoder values of the part's motors at the last tick, (n_part,) rad."""
        return self._runner.q[self.robot.part(part).slice].copy()

    def act(self, part: str, target: Array, reaching: str | None = None) -> Outcome:
        """Set the part's attractor to `target` (n_part,) rad, run until the part has settled or timed out, and return the outcome.

        `reaching`: name of a marker; during the action, world objects with the role "target" do not repel the hand that carries it. Raises
        InvalidValue while another part is acting (then use `begin` and `advance`).
        """
        self._require_alone(part, "act")
        exempt = None if reaching is None else self.robot.marker(reaching).name
        self.begin(part, target)
        self._reaches.exempt = exempt
        try:
            return self.advance()[0][1]
        finally:
            self._reaches.exempt = None

    def begin(self, part: str, target: Array) -> None:
        """Start an action: set the part's attractor to `target` (n_part,) rad; the action ends when the part has settled or timed out.

        A reach of the part that is in progress is cancelled. Raises InvalidValue for a target beyond the motors' limits.
        """
        self.robot.part(part)
        self._actions.require_possible(part, target)
        self._controller.set_attractor(part, target)
        self._reaches.drop(part)
        self._test(part)

    def present(self, target: ReachTarget | None) -> None:
        """Add the target of reaches to the world as the object `TARGET` with role "target", or move it there; None removes it.

        The target may also be moved during a reach, but not removed (InvalidValue).
        """
        self._reaches.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Pull the marker to the presented target until the part has settled or timed out, then end the force; return the outcome.

        `stay`: True: the part stays in the pose in which the force ended; False: it returns to its attractor. Raises InvalidValue if no
        target is presented, or while another part is acting.
        """
        self._require_alone(part, "reach")
        self.begin_reach(part, marker, stay)
        self.advance()
        return self.reached(part)

    def begin_reach(self, part: str, marker: str, stay: bool = False) -> None:
        """Start to pull the marker of a part to the presented target; `advance` then runs until the whole reach has ended.

        The force ends when the part has settled or timed out. `stay`: False: the part then returns to its attractor, and the reach ends
        when it has settled or timed out again. True: the part stays in the pose in which the force ended, and the reach ends there.
        """
        self._reaches.begin(part, marker, stay)
        self._test(part)

    def reached(self, part: str) -> ReachOutcome:
        """Return the outcome of the part's last reach; raise InvalidValue if no reach of the part has ended."""
        return self._reaches.outcome(part)

    def follow(self) -> None:
        """Pass the pose of the last tick to the world, which needs it to attach and detach objects.

        It is called at the end of every action, but not in a run of a `PlantBatch`, whose plants share one world.
        """
        self.model.world.follow(self.model.evaluate(self.q))

    def every(self, ticks: int, callback: Callable[[float], None] | None) -> None:
        """Call `callback` with the plant's time [s] every `ticks` ticks; None: stop the calls.

        The callback may change the world. A new callback replaces the present one.
        """
        self._period, self._callback = checked_count("ticks", ticks, 1), callback

    def advance(self) -> list[tuple[str, Outcome]]:
        """Run until at least one acting part has ended; return the names and outcomes of the parts that ended, in the robot's order.

        For a reach that was begun with `stay` False (see `begin_reach`), the outcome is that of the return to the attractor (the position
        to which the part's springs pull it); with `stay` True, that of the motion towards the target. `reached` returns the outcome of the
        whole reach. Raises InvalidValue if no part is acting.
        """
        return finished(self.advancing())

    def advancing(self) -> Work[list[tuple[str, Outcome]]]:
        """Return the computation of `advance` as a generator of its steps, for a caller that runs several plants at once.

        Each step yields the memory address of the plant's structure, which the compiled core must run next; the return value is that of
        `advance`.
        """
        acting = self._actions.under_way
        if not acting:
            raise InvalidValue("no part is acting: call begin first")
        done: list[str] = []
        while not done:
            yield from self._ticks_of(CHUNK)
            now = self._actions.under_way
            done = [part for part in acting if part not in now]
        return [(part, self._reaches.after(part) or self._outcome(part)) for part in done]

    def tick(self) -> None:
        """Run one control tick: read the encoders, compute the contacts and the control law, and move the motors.

        The motors move by the command that was computed `command_age` ticks ago (`PlantSettings`). If an action ends in this tick, a later
        `advance` does not return its outcome.
        """
        finished(self._ticks_of(1))

    def run(self, ticks: int) -> Trace:
        """Run exactly `ticks` ticks; return positions, velocities and contact depths, one row per tick, as a `Trace`.

        The end of an action does not stop the run. Raises InvalidValue unless `ticks` is a whole number of at least 0.
        """
        return finished(self.running(ticks))

    def running(self, ticks: int) -> Work[Trace]:
        """Return the computation of `run` as a generator of its steps, for a caller that runs several plants at once.

        Each step yields the memory address of the plant's structure, which the compiled core must run next; the return value is that of
        `run`. `ticks`: number of ticks.
        """
        rows, left = [np.zeros((0, 3 * len(self.robot.motors) + 2))], checked_count("ticks", ticks)
        while left > 0:
            rows.append((yield from self._ticks_of(min(left, CHUNK), traced=True)))
            left -= len(rows[-1])
        return Trace.of(np.concatenate(rows))

    @property
    def address(self) -> int:
        """The memory address of the plant's structure in the core, which `PlantBatch` passes to the core."""
        return self._runner.address

    def prepare_batch(self, deepest: Array) -> bool:
        """Prepare the plant for a run that `PlantBatch` starts in the compiled core; return False if Python is needed in its ticks.

        `deepest`: (2,) m, depths of the deepest contact of solids and of the deepest contact of fields (volumes that cause repulsive
        forces). The core increases a number when a contact in a tick is deeper. The caller must keep the array alive, and call `conclude`
        after each run.
        """
        if self._digest is not None or self._callback is not None or self._reaches.exempt or self._runner.needs_python:
            return False
        self._runner.prepare_batch(deepest)
        return True

    def _ticks_of(self, most: int, traced: bool = False) -> Work[Array]:
        """Run up to `most` ticks, or until an action ends; return the record (ticks, 3 n + 2) as `conclude` does.

        The record is empty unless `traced`, or unless the plant computes a digest of its encoder values.
        """
        if self._callback is not None:
            most = min(most, self._period - self._runner.ticks % self._period)
        self._acting = len(self._actions.under_way)
        address = self._runner.prepare(most, traced or self._digest is not None, traced, self.reaching)
        try:
            yield address
        finally:  # also the ticks before a Ctrl-C
            rows = self.conclude()
        return rows

    def conclude(self) -> Array:
        """Update the plant after the compiled core has run ticks; return one row per recorded tick, (ticks, 3 n + 2).

        A row has the encoders, joint positions and velocities (n each), then the depths [m] of the deepest contact of solids and of the
        deepest contact of fields (volumes that cause repulsive forces). There are no rows if the ticks were not recorded. Raises
        ActionInterrupted if the motors' state is no longer finite.
        """
        rows, done, lost = self._runner.results()
        if done:
            self._pose = None
            if self._digest is not None:
                self._digest.update(np.ascontiguousarray(rows[:, : len(self.robot.motors)]).astype("<f8").tobytes())
        if lost:
            self._actions.end_all()
            for part in self._reaches.running:
                self._reaches.drop(part)
            raise ActionInterrupted(f"the motors' state is not finite at {self.time:.3f} s: nothing was observed")
        if self._acting > len(self._actions.under_way):
            self.follow()
        if self._reaches.running:
            self._let_go()
        if self._callback is not None and self._runner.ticks % self._period == 0:
            self._callback(self.time)
        return rows

    def _let_go(self) -> None:
        """End the force on parts whose reach has settled or timed out, so that their attractors pull them back."""
        for part in self._reaches.running:
            if part not in self._actions.under_way:
                if self._reaches.ended(part, self._outcome(part), self.model.evaluate(self.q)):
                    self._test(part)

    def _test(self, part: str) -> None:
        """Start a new test whether the part has settled (stands still), at the time of the tick that has just ended, as in the live system.

        The next tick is then the first tick of the action; `Settle.first_check` is the time [s] from the start to the first check.
        """
        self._actions.begin(part, self.time - self.dt, self.controller.gains.settle.first_check)

    def _require_alone(self, part: str, doing: str) -> None:
        if others := [other for other in self._actions.under_way if other != part]:
            raise InvalidValue(f"{doing}({part!r}) while {', '.join(others)} is acting: use begin and advance for several parts")

    def _outcome(self, part: str) -> Outcome:
        return self._actions.outcome(part, self._runner.q, self.time - self.dt, self._touched(part))

    def _touched(self, part: str) -> tuple[str, ...]:
        """Return the sorted names of the free world objects that touch the part in the present pose; see `touched_by`.

        Self-contacts are not computed.
        """
        snapshot = self.model.world.snapshot
        if not snapshot.names:
            return ()
        return touched_in(
            self._touching.contacts_of_one(self._runner.q.tobytes(), snapshot, self.model.hands(self.reaching))[0], self._moved[part]
        )
