# SPDX-License-Identifier: Apache-2.0
"""Shallow contact recovery: the reflex when the hand enters the table's field at a low angle.

Claim: the reflex of MoBeE 1.0, which moves the arm back along its recent poses, recovers from steep contacts.  The flatter the approach,
the more often the recovery fails and control switches between client and reflex, because encoder noise decides what counts as contact.  A
filter of the contacts and a dead time of the reflex prevent most of these failures.  MoBeE 2.0 lets the hand slide along the surface at any
angle, and the arm settles.  Source: thesis 4.4 (discussion), which gives no numbers.  Run time: 5 to 10 minutes for 10 angles with 30
trials of each of four variants.

A client drives the left hand at 20 % speed along a straight path from 6 cm before the surface of the table's field (the zone around the
table in which the fields of the hand, volumes that are not solid, overlap the table) to 4 cm behind it.  For 12 s it tries again whenever
it gets control back.  The motors have lag, delay, play and encoder noise; a tick is 10 ms.  Variants: off = no reflex; naive = MoBeE 1.0 as
chapter 4.1 describes it; mended = with filter and dead time; 2.0 = the client's references are attractors of the controller.  The first
recovery of each trial counts.  It succeeds if the hand ends without contact, did not touch again or sink deeper while it moved back, and
the next reflex does not start within 0.3 s after the client has got control back.  It is clean if in addition the encoders reported no
contact during the motion back.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any

import numpy as np

from experiments.claims.ch4_reflex.shallow_contact_paths import MARKER, SPEED, Client, HandPath, Spot, Table
from experiments.kit.command_line import positive_number, positive_whole
from experiments.kit.experiment import Experiment
from experiments.kit.plots import new_figure
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee.arrays import Array
from mobee.control import Controller, Gains, SettleTest
from mobee.control.reflex import Recovery, Reflex, ReflexSettings
from mobee.simulation.motors import NOISE_PERIOD, MotorParameters, Motors

ANGLES = (90.0, 60.0, 30.0, 20.0, 10.0, 7.0, 5.0, 3.0, 2.0, 1.0)  # degrees
SHARES = ("recovered", "clean", "again", "came_back", "never", "deeper", "relapse", "settled", "switches", "flips", "flicker")
MAX_FLAT_ANGLE = 3.0  # degrees, of a flat path
QUICK_ANGLES, QUICK_SPOTS, QUICK_REPEAT = (60.0, 2.0), 2, 1

DT = 0.01  # s
SECONDS = 12.0
RELAPSE_TIME = 0.3  # s after control is given back; shorter than the motion from the start to the contact
UNLIMITED = 1e6  # rad/s, velocity limit of the naive reflex: none
SETTINGS = {"naive": ReflexSettings.naive(), "mended": ReflexSettings()}
VARIANTS = ("off", *SETTINGS, "2.0")

STOPPING_TICKS = 30  # until the robot has stopped
DEEPER_BY = 1e-3  # m beyond the depth during the stop, from which the motion back counts as deeper

COLORS = {"off": "0.6", "naive": "tab:red", "mended": "tab:orange", "2.0": "tab:blue"}
LABELS = {"off": "no reflex", "naive": "1.0, naive", "mended": "1.0, filter and dead time", "2.0": "2.0"}
DEPTHS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # mm, marked
SWITCHING = ("naive", "mended")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --angles, --spots and --repeat to the parser."""
    parser.add_argument("--angles", nargs="+", type=positive_number, default=list(ANGLES), metavar="DEG", help="of the approach, degrees")
    parser.add_argument("--spots", type=positive_whole, default=10, metavar="N", help="places on the table (default: 10)")
    parser.add_argument("--repeat", type=positive_whole, default=3, metavar="N", help="trials at each place, other noise (default: 3)")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the conditions of the sweep: one for each pair of an angle of approach and a spot.

    A spot is a place at which the hand just touches the table's field, the zone in which the fields of the hand overlap the table.  Each
    seed draws other spots.
    """
    angles, spots, repeat = arguments.angles, arguments.spots, arguments.repeat
    if arguments.quick:
        angles, spots, repeat = QUICK_ANGLES, min(spots, QUICK_SPOTS), min(repeat, QUICK_REPEAT)
    return [
        Condition(f"{angle:g}-{spot}", {"angle": angle, "spot": spot, "spots": spots, "repeat": repeat})
        for angle in angles
        for spot in range(spots)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Run all variants ("off", "naive", "mended", "2.0") at one spot and one angle, each several times with different encoder noise.

    Returns a dict with the key "trials": a list of dicts with the fields of `Trial`.  The list is empty if the arm cannot follow a path at
    this angle.  `settings`: "spot", index of the spot, a place at which the hand touches the table's field; "spots", how many spots are
    drawn; "angle" [deg]; "repeat", number of repetitions.  `seed`: of the spots and the noise.
    """
    table, spot, angle = _table(), settings["spot"], settings["angle"]
    path = table.path(_spots(settings["spots"], seed)[spot], np.deg2rad(angle))
    if path is None:
        return {"trials": []}
    noises = range(seed, seed + settings["repeat"])
    return {"trials": [asdict(run_trial(table, path, variant, angle, spot, noise)) for noise in noises for variant in VARIANTS]}


@cache
def _table() -> Table:
    return Table()


@cache
def _spots(count: int, seed: int) -> list[Spot]:
    return _table().spots(count, seed)


class Truth:
    """Records the depths of contacts, and the first recovery (motion back along earlier poses), from the true joint positions.

    `depth`: depth of the deepest contact, of fields or solids [m].  `solid`: the same for solids only.  `progress`: largest distance [m] of
    the hand from the start of the straight approach, along the table.  `flips`: number of changes between contact and no contact, by the
    encoders.  `flicker`: ticks from the first contact to the last pose without contact, by the encoders.  Of the first recovery, `again`: a
    contact came back, by the encoders; `came_back`: the same by the true positions; `never`: the hand was still in contact at the end;
    `deeper`: the hand was more than 1 mm deeper while it moved back than while it stopped.
    """

    def __init__(self, table: Table, path: HandPath) -> None:
        self._track = table.model.track()
        start, end = (table.model.evaluate(path.postures[i]).position(MARKER)[:2] for i in (path.start, -1))
        length = float(np.linalg.norm(end - start))
        self._start, self._along = start, (end - start) / length if length > DEEPER_BY else np.zeros(2)
        self.depth = self.solid = self.progress = 0.0
        self.flips = self.flicker = 0
        self.again = self.came_back = self.never = self.deeper = False
        self._seen = False
        self._since_first = -1  # ticks since the encoders first reported a contact
        self._first: Recovery | None = None
        self._depths: list[float] = []  # along the first recovery
        self._is_over = False

    def update(self, q: Array, seen: bool, reflex: Reflex | None) -> None:
        """Record a tick.

        `q`: true positions (n,) rad.  `seen`: whether the pose of the encoder values has a violation, such as a contact.  `reflex`: the
        reflex after this tick; None for MoBeE 2.0.
        """
        pose = self._track.evaluate(q)
        depths = {"solid": 0.0, "field": 0.0}
        for contact in pose.contacts:
            depths[contact.kind] = max(depths[contact.kind], float(contact.depth))
        depth = max(depths.values())
        self.depth, self.solid = max(self.depth, depth), max(self.solid, depths["solid"])
        self.progress = max(self.progress, float((pose.position(MARKER)[:2] - self._start) @ self._along))
        self.flips += seen != self._seen
        self._seen = seen
        if seen or self._since_first >= 0:
            self._since_first += 1
            if not seen:
                self.flicker = self._since_first
        if reflex is not None and reflex.recovery is not None and not self._is_over:
            self._follow(reflex.recovery, depth)

    def finish(self) -> None:
        """Evaluate the first recovery (motion back along earlier poses) at the end of the trial, if it is not complete by then."""
        if not self._is_over and self._first is not None:
            self._conclude(self._first, self._depths[-1])

    def _follow(self, recovery: Recovery, depth: float) -> None:
        """Record the depth of a tick of the first recovery, and compute its results when it has ended.

        `recovery`: the present recovery.  `depth`: depth of the deepest contact in this tick [m].
        """
        if self._first is None:
            self._first = recovery
        self._depths.append(depth)
        if self._first.outcome != "under way":
            self._conclude(self._first, depth)

    def _conclude(self, recovery: Recovery, depth: float) -> None:
        self._is_over = True
        touching = np.array(self._depths) > 0.0
        left = np.flatnonzero(touching[:-1] & ~touching[1:])
        self.again = recovery.again > 0
        self.came_back = bool(len(left)) and bool(touching[left[0] + 1 :].any())
        self.never = depth > 0.0
        stop, back = self._depths[:STOPPING_TICKS], self._depths[STOPPING_TICKS:]
        self.deeper = bool(back) and max(back) > max(stop) + DEEPER_BY


@dataclass(frozen=True, slots=True)
class Trial:
    """Measurements of a trial.

    `variant`: "off" (no reflex), "naive" (reflex of MoBeE 1.0), "mended" (the same, but violations count only after a minimum duration, and
    the reflex brakes before it moves back and waits afterwards) or "2.0" (controller of MoBeE 2.0).  `angle`: of approach, degrees.
    `spot`: index of the place at which the hand touches.  `seed`: of the encoder noise.  `depth`: depth of the deepest contact, of fields
    or solids [m], by the true positions; `solid`: the same for solids.  `switches`: changes of control between client and reflex, per
    second.  `flips`: changes between contact and no contact per second, by the encoders.  `flicker`: time [s] from the first contact to the
    last pose without contact by the encoders, only for the variant "off"; 0 for the others.  `reflexes`: number of reflexes.

    Of the first recovery, `again`: a contact came back, by the encoders; `came_back`: the same by the true positions; `never`: the hand was
    still in contact at the end of the recovery or of the trial; `deeper`: the hand was more than 1 mm deeper while it moved back than while
    it stopped; `relapse`: the second reflex started within 0.3 s after the first one gave control back to the client.  `settled`: whether
    the arm came to rest after the client's last reference, only for the variant "2.0"; False for the others.  `progress`: largest distance
    [m] of the hand from the start of the straight approach, along the table.
    """

    variant: str
    angle: float
    spot: int
    seed: int
    depth: float
    solid: float
    switches: float
    flips: float
    flicker: float
    reflexes: int
    again: bool
    came_back: bool
    never: bool
    deeper: bool
    relapse: bool
    settled: bool
    progress: float

    @property
    def recovered(self) -> bool:
        """Whether the first recovery succeeded (MoBeE 1.0 only).

        It succeeds if four conditions hold.  The hand has no contact at the end of the recovery or of the trial.  It did not touch again
        after a contact had ended.  While it moved back, it was at most 1 mm deeper in contact than while it stopped.  The next reflex does
        not start within 0.3 s (RELAPSE_TIME) after the client has got control back.  The first three are judged by the true positions.
        Without a reflex it is False.
        """
        return self.reflexes > 0 and not (self.came_back or self.never or self.deeper or self.relapse)

    @property
    def clean(self) -> bool:
        """Whether the first recovery succeeded and the encoders reported no contact during the motion back (MoBeE 1.0 only)."""
        return self.recovered and not self.again


def run_trial(table: Table, path: HandPath, variant: str, angle: float, spot: int, seed: int) -> Trial:
    """Run a trial of 12 s and return its measurements.

    `variant`: "off" (no reflex), "naive" (reflex of MoBeE 1.0), "mended" (the same with filter and dead time) or "2.0" (controller of MoBeE
    2.0).  `angle`: of the path, degrees; it is only stored.  `spot`: index of the place at which the hand touches; with `seed` it
    determines the encoder noise.
    """
    client = Client(table.robot, path, DT)
    body = _Body(table, client.start, np.random.default_rng([seed, spot, 0x677A]))
    truth = Truth(table, path)
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
    """The ticks at which the reflex took control (`taken`), and at which it gave control back to the client (`given`)."""

    taken: list[int] = field(default_factory=list)
    given: list[int] = field(default_factory=list)

    @property
    def switches(self) -> int:
        """The number of changes of control between client and reflex."""
        return len(self.taken) + len(self.given)

    @property
    def relapsed(self) -> bool:
        """Whether the second reflex started within 0.3 s (RELAPSE_TIME) after the first one gave control back."""
        return len(self.taken) > 1 and (self.taken[1] - self.given[0]) * DT <= RELAPSE_TIME


class _Body:
    """Motors and encoders; a command acts one tick after it was formed, as in the live system."""

    def __init__(self, table: Table, q: Array, rng: np.random.Generator) -> None:
        parameters = MotorParameters()
        self._motors = Motors(table.robot, parameters, 0, q)
        self._substeps = parameters.substeps(DT)
        self._noise = parameters.encoder_noise * np.sqrt(NOISE_PERIOD / DT)
        self._rng = rng

    @property
    def q(self) -> Array:
        """The true joint positions, (n,) rad."""
        return self._motors.q

    def encoders(self) -> Array:
        """Return noisy encoder readings, (n,) rad."""
        q: Array = self._motors.q + self._noise * self._rng.standard_normal(len(self._motors.q))
        return q

    def tick(self, mode: str, reference: Array) -> None:
        """Simulate one tick, in which the motors execute the command that was computed in the previous tick.

        `mode`: "velocity" or "position".  `reference`: the command for all motors (n,), in rad/s or rad.
        """
        self._motors.command(slice(None), "velocity" if mode == "velocity" else "position", reference)
        self._motors.move(self._substeps, DT / self._substeps)


def _switch(table: Table, client: Client, body: _Body, truth: Truth, settings: ReflexSettings | None) -> Control:
    """Run the client for 12 s with the reflex of MoBeE 1.0; if `settings` is None, without a reflex.

    While the reflex has control, the motors follow its target positions, else those of the client.  Each tick is recorded in `truth`.
    Returns the ticks at which the control changed between client and reflex.
    """
    limit = np.full(len(table.robot.motors), UNLIMITED)
    if settings is not None and settings.brake:
        limit = np.array([motor.max_velocity for motor in table.robot.motor_table])
    reflex = Reflex(settings or ReflexSettings(confirm=SECONDS + 1.0), DT, limit)
    track, command, control = table.model.track(), client.start, Control()
    for k in range(round(SECONDS / DT)):
        body.tick("position", command)
        q = body.encoders()
        violations = table.watch.check(track.evaluate(q))
        target = reflex.tick(q, violations)
        truth.update(body.q, bool(violations), reflex)
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
    """Run the controller of MoBeE 2.0 for 12 s, with the client's position references as attractors, and record each tick in `truth`.

    Returns True if the left arm settled after the last reference, that is, if its commanded speed and acceleration fell below the
    thresholds of `Settle` before the timeout.
    """
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
        truth.update(body.q, bool(table.watch.check(pose)), None)
        if client.is_over and test is None:
            test = SettleTest(controller.gains.settle, k * DT)
        if test is not None and verdict == "moving":
            verdict = test.update(k * DT, controller.velocity[arm], controller.acceleration[arm])
    return verdict == "settled"


def findings(found: Cells) -> dict[str, Any]:
    """Return "passed", whether the claim holds, and for each variant a dict from the angle [degrees, as text] to the dict of `summary`."""
    return results(_trials(found))


def results(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return "passed", whether the claim holds, and for each variant a dict from the angle [degrees, as text] to the dict of `summary`."""
    angles = sorted({trial.angle for trial in trials}, reverse=True)
    table: dict[str, Any] = {
        variant: {f"{angle:g}": summary([t for t in trials if (t.variant, t.angle) == (variant, angle)]) for angle in angles}
        for variant in VARIANTS
    }
    return {"passed": holds(trials), **table}


def summary(trials: Sequence[Trial]) -> dict[str, float]:
    """Return the means and extremes over the trials of one variant at one angle; {"trials": 0} if there are none.

    Keys: "trials", number of trials; the names in SHARES, such as "recovered" and "switches", with the means of these attributes of
    `Trial`; "depth_mm_median", "depth_mm_max" and "solid_mm_max", depths of contacts; "progress_cm", mean of `progress` in cm.
    """
    if not trials:
        return {"trials": 0}

    def share(name: str) -> float:
        return round(float(np.mean([getattr(trial, name) for trial in trials])), 3)

    return {
        "trials": len(trials),
        **{name: share(name) for name in SHARES},
        "depth_mm_median": round(1e3 * float(np.median([trial.depth for trial in trials])), 1),
        "depth_mm_max": round(1e3 * max(trial.depth for trial in trials), 1),
        "solid_mm_max": round(1e3 * max(trial.solid for trial in trials), 1),
        "progress_cm": round(1e2 * float(np.mean([trial.progress for trial in trials])), 1),
    }


def holds(trials: Sequence[Trial]) -> bool:
    """Return whether the claim holds.

    For angles of at most 3 degrees, the variant "naive" (reflex of MoBeE 1.0) must recover less often than for steeper angles, and "mended"
    (the same with filter and dead time) more often and with fewer changes of control than "naive".  At all angles, "2.0" (controller of
    MoBeE 2.0) must settle without contact of solids.
    """

    def share(name: str, variant: str, low: bool) -> float:
        values = [getattr(t, name) for t in trials if t.variant == variant and (t.angle <= MAX_FLAT_ANGLE) == low]
        return float(np.mean(values)) if values else float("nan")

    naive_low, naive_steep = share("recovered", "naive", True), share("recovered", "naive", False)
    switching = share("switches", "mended", True) < share("switches", "naive", True)
    deflected = [trial for trial in trials if trial.variant == "2.0"]
    calm = bool(deflected) and all(t.settled and t.solid == 0.0 for t in deflected)
    return naive_low < naive_steep and share("recovered", "mended", True) > naive_low and switching and calm


def _trials(found: Cells) -> list[Trial]:
    return [Trial(**one) for result in found.values() for one in result.values["trials"]]


def plot(found: Cells) -> Any:
    """Return a figure of recovery, changes of control, depth and progress over the angle of approach."""
    trials = _trials(found)
    drawing = new_figure(10.0, 7.0)
    (success, switching), (depth, progress) = drawing.subplots(2, 2, sharex=True)
    _curves(success, trials, SWITCHING, lambda t: 100.0 * t.recovered)
    _curves(success, trials, SWITCHING, lambda t: 100.0 * t.clean, "--")
    _curves(success, trials, ("2.0",), lambda t: 100.0 * t.settled)
    success.set(ylabel="share of trials [%]", ylim=(-3.0, 103.0))
    success.set_title("1.0: the first recovery succeeds (dashed: and is clean); 2.0: settles", fontsize=9)
    _curves(switching, trials, SWITCHING, lambda t: t.switches)
    switching.set(ylabel="switches of control per second", ylim=(0.0, None))
    _curves(depth, trials, tuple(LABELS), lambda t: 1e3 * t.depth)
    depth.set(ylabel="deepest in the table's field [mm]", xlabel="angle of approach [degrees]", yscale="symlog", ylim=(0.0, None))
    depth.set_yticks(DEPTHS, [f"{each:g}" for each in DEPTHS])
    _curves(progress, trials, tuple(LABELS), lambda t: 1e2 * t.progress)
    progress.set(ylabel="how far along the table [cm]", xlabel="angle of approach [degrees]")
    for axes in (success, switching, depth, progress):
        axes.set_xscale("log")
        axes.set_xticks(angles := _angles(trials), [f"{angle:g}" for angle in angles], minor=False)
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    depth.legend(fontsize=8)
    drawing.suptitle("Thesis 4.4: a hand meets the table at 20 % speed, its client tries again (mean, standard error)")
    return drawing


def _angles(trials: Sequence[Trial]) -> list[float]:
    return sorted({trial.angle for trial in trials})


def _curves(axes: Any, trials: Sequence[Trial], variants: Sequence[str], value: Callable[[Trial], float], line: str = "-") -> None:
    """Draw mean and standard error against the angle."""
    for variant in variants:
        rows = []
        for angle in _angles(trials):
            values = [value(trial) for trial in trials if (trial.variant, trial.angle) == (variant, angle)]
            if values:
                rows.append((angle, float(np.mean(values)), float(np.std(values)) / np.sqrt(len(values))))
        if rows:
            x, mean, error = zip(*rows, strict=True)
            axes.errorbar(x, mean, error, linestyle=line, marker="o", markersize=3, capsize=2, color=COLORS[variant], label=LABELS[variant])


EXPERIMENT = Experiment(
    claim="the flatter the hand approaches a contact, the more often rewinding fails; MoBeE 2.0 slides and settles at every angle",
    source="thesis 4.4",
    method=Sweep(conditions, trial, findings, plot, seeds=1, add_options=add_options),
)
