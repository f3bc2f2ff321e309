# SPDX-License-Identifier: Apache-2.0
"""The offline plant, a simulation of the robot in one process: its speed compared with MuJoCo's stepper, and that of a batch.

One arm moves to random states of its lattice, one arm reaches for targets, and three curious agents act at the table, as in the published
experiments.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

import mobee
from experiments.bench.peers import load_mujoco, us_per_tick
from experiments.bench.timing import Calibration, cores_text, medians, one_core, some_cores
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress
from mobee import Gains, Lattice, Model, OfflinePlant, ReachTarget, World, advance_together
from mobee.robot.robot import Robot

SEED = 2014
DT = 0.02  # s, the published control period
TORSO = ("torso_yaw", "torso_roll", "torso_pitch")
LEFT = ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow")
RIGHT = tuple("r" + name[1:] for name in LEFT)
LEVELS = (0.2, 0.4, 0.6, 0.8)  # of the one arm: 256 states
WARM_UP = 5  # actions that do not count
PLANTS = 64  # of a batch
RUNS = {"one_arm": "one arm, 256 states", "reaching": "one arm, reaching", "three_agents": "three agents at the table"}

REQUIREMENTS = (
    Requirement("one arm, times real time", ("one_arm", "standard_times_real_time"), at_least=9000.0, aim=24_000.0),
    Requirement("one arm, actions/s", ("one_arm", "standard_actions_per_second"), at_least=1400.0, aim=3700.0),
    Requirement("one arm reaching, times real time", ("reaching", "standard_times_real_time"), at_least=6000.0, aim=16_000.0),
    Requirement("three agents at the table, transitions/s", ("three_agents", "standard_actions_per_second"), at_least=1500.0, aim=4200.0),
    Requirement(f"{PLANTS} plants in a batch, times one alone", ("batch", "ratio"), at_least=1.5),  # ticks a second of processor time
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Sizes and repetitions of the runs.

    `actions`: number of actions in a run of one arm.  `reaches`: number of reaches in a run of one arm.  `transitions`: number of
    transitions in a run of three agents.  `hashed`: number of actions of the trajectory whose hash is computed twice.  `ticks`: number of
    control ticks for which MuJoCo's steps are timed.  `batched`: number of actions of each plant of a batch.  `rounds`: number of
    repetitions, of which the median is reported.
    """

    actions: int = 1000
    reaches: int = 500
    transitions: int = 3000
    hashed: int = 50
    ticks: int = 5000
    batched: int = 20
    rounds: int = 3


QUICK = Settings(actions=100, reaches=50, transitions=300, hashed=10, ticks=500, batched=2, rounds=1)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises NotInstalled without MuJoCo.

    Main keys: "one_arm", "reaching" and "three_agents", each a dict with the median rates of `Pace.numbers` and `Pace.standard`;
    "mujoco_us_per_tick", MuJoCo's processor time of a tick, and "times_mujoco", this time divided by that of our plant with one arm;
    "batch", the result of `measure_batch`; "requirements", a list with the dict that `Requirement.judge` returns for each requirement;
    "same_hash", whether two equal runs made the same trajectory; "passed", whether all requirements are met and the hashes are equal.
    """
    load_mujoco()
    runs: dict[str, Callable[[], Pace]] = {
        "one_arm": lambda: one_arm(arm_plant(), settings.actions),
        "reaching": lambda: one_arm_reaching(arm_plant(), settings.reaches),
        "three_agents": lambda: three_agents(settings.transitions),
    }
    found: dict[str, list[dict[str, float]]] = {name: [] for name in runs}
    mujoco, ratios, speeds = [], [], Calibration()
    with one_core() as core, Progress() as progress:
        for number in range(settings.rounds):
            for part, (name, run) in enumerate(runs.items()):
                progress.show((number + 0.25 * part) / settings.rounds, name.replace("_", " "))
                pace, speed = speeds.around(run)
                found[name].append(pace.numbers | pace.standard(speed))
            progress.show((number + 0.9) / settings.rounds, "MuJoCo")
            mujoco.append(us_per_tick(arm_plant(), settings.ticks))
            ratios.append(mujoco[-1] / found["one_arm"][-1]["us_per_tick"])
        hashes = [trajectory_hash(settings.hashed) for _ in range(2)]
    result: dict[str, Any] = {name: medians(rounds) for name, rounds in found.items()}
    result |= {"tick": DT, "core": core, "rounds": settings.rounds, "speed": speeds.median}
    result |= {"mujoco_us_per_tick": float(np.median(mujoco)), "times_mujoco": float(np.median(ratios))}
    result["batch"] = measure_batch(settings.batched, max(5, settings.rounds) if settings.rounds > 1 else 1)
    return result | verdict(result, REQUIREMENTS, same_hash=hashes[0] == hashes[1])


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each kind of run, then the requirements."""
    lines = [
        f"Ticks of {1e3 * result['tick']:g} ms, motor substeps of 5 ms; processor time",
        f"{cores_text(result['core'])}, rounds: {result['rounds']} (the median counts).",
        f"{'':<32}{'x real time':>12}{'ended/s':>10}{'us/tick':>9}{'s/action':>10}",
    ]
    for name, title in RUNS.items():
        one = result[name]
        rates = f"{one['times_real_time']:>12.0f}{one['actions_per_second']:>10.0f}{one['us_per_tick']:>9.2f}"
        lines.append(f"{title:<32}{rates}{one['seconds_per_action']:>10.2f}")
    lines.append(
        f"MuJoCo's stepper, one arm: {result['mujoco_us_per_tick']:.1f} us a tick, {result['times_mujoco']:.1f} times ours. It solves\n"
        "rigid-body dynamics and contact, which our motors do not have; it has no model,\nlaw or encoders."
    )
    lines.append(batch_text(result["batch"]))
    same = "yes" if result["same_hash"] else "NO"
    return "\n".join([report_text(lines, result), f"  same seed, same trajectory hash: {same}"])


@dataclass(frozen=True, slots=True)
class Pace:
    """Times and counts of one run.

    `seconds`: processor time of this process [s].  `plant_seconds`: simulated time of all plants [s].  `ticks`: number of ticks of all
    plants.  `ended`: number of actions, reaches or transitions that ended.  `wall_seconds`: wall time of the run [s].
    """

    seconds: float
    plant_seconds: float
    ticks: int
    ended: int
    wall_seconds: float = float("nan")

    @property
    def numbers(self) -> dict[str, float]:
        """The rates of the run, by their names in the JSON result; they are computed from the processor time.

        Keys: "times_real_time", simulated over processor time; "actions_per_second"; "us_per_tick", processor time of a tick [us];
        "seconds_per_action", simulated time of an action [s].
        """
        return {
            "times_real_time": self.plant_seconds / self.seconds,
            "actions_per_second": self.ended / self.seconds,
            "us_per_tick": 1e6 * self.seconds / self.ticks,
            "seconds_per_action": self.plant_seconds / self.ended,
        }

    def standard(self, speed: float) -> dict[str, float]:
        """Return two of the rates as they are on the standard machine, the one for which the requirements were set.

        `speed`: the speed of this machine during the run, in multiples of the standard machine's (timing.py).  Keys:
        "standard_times_real_time" and "standard_actions_per_second".
        """
        return {f"standard_{key}": self.numbers[key] / speed for key in ("times_real_time", "actions_per_second")}


class Stopwatch:
    """Sums the processor time, the wall time and the simulated time of plants over all contexts of `running`."""

    def __init__(self, *plants: OfflinePlant) -> None:
        self._plants = plants
        self._seconds = self._wall = self._plant_seconds = 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Measure the work that is done inside this context manager."""
        begin, wall, start = self._plant_time(), time.perf_counter(), time.process_time()
        yield
        self._seconds += time.process_time() - start
        self._wall += time.perf_counter() - wall
        self._plant_seconds += self._plant_time() - begin

    def pace(self, ended: int) -> Pace:
        """Return the times and rates measured so far.  `ended`: number of actions, reaches or transitions in the measured time."""
        return Pace(self._seconds, self._plant_seconds, round(self._plant_seconds / self._plants[0].dt), ended, self._wall)

    def _plant_time(self) -> float:
        return sum(plant.time for plant in self._plants)


def robot() -> Robot:
    """Return the robot of the published experiments, "icub_2014"."""
    return mobee.load_robot("icub_2014")


def arm_plant(dt: float = DT, world: World | None = None, hashed: bool = False) -> OfflinePlant:
    """Return an offline plant in which only the four motors of the left arm move, with the published gains and self-collision.

    `dt`: control tick [s].  `world`: None: an empty one.  `hashed`: whether the plant computes a hash of its trajectory.
    """
    return OfflinePlant(Model(robot(), world), SEED, Gains.published_2014(), dt=dt, active=LEFT, hashed=hashed)


def one_arm(plant: OfflinePlant, actions: int) -> Pace:
    """Measure `actions` actions of the left arm to random states of its lattice (256 states)."""
    space = Lattice(plant.robot, LEFT, LEVELS)
    goals = [space.target(int(state)) for state in np.random.default_rng(SEED).integers(len(space), size=actions + WARM_UP)]
    for goal in goals[:WARM_UP]:
        plant.act("left_arm", goal)
    watch = Stopwatch(plant)
    with watch.running():
        for goal in goals[WARM_UP:]:
            plant.act("left_arm", goal)
    return watch.pace(actions)


def one_arm_reaching(plant: OfflinePlant, reaches: int) -> Pace:
    """Measure reaches of the left palm from random states of the lattice to random targets in front of the arm.

    The actions that move the arm to a start are not counted.
    """
    space, rng = Lattice(plant.robot, LEFT, LEVELS), np.random.default_rng(SEED)
    warm_up, watch = Stopwatch(plant), Stopwatch(plant)
    for number in range(reaches + WARM_UP):
        plant.act("left_arm", space.target(int(rng.integers(len(space)))))
        plant.present(ReachTarget(rng.uniform((-0.4, -0.4, 0.0), (-0.1, 0.0, 0.4))))
        with (watch if number >= WARM_UP else warm_up).running():
            plant.reach("left_arm", "left_palm")
    return watch.pace(reaches)


def three_agents(transitions: int) -> Pace:
    """Measure transitions of three curious agents at the table, without a file of transitions.

    The agents are those of the torso, 27 states with 8 neighbours, and of both arms, 81 states with 16 neighbours each.
    """
    plant = OfflinePlant(Model(robot(), mobee.load_world("table")), SEED, Gains.published_2014(), dt=DT, active=(*TORSO, *LEFT, *RIGHT))
    spaces = [Lattice(plant.robot, motors, neighbours=count) for motors, count in ((TORSO, 8), (LEFT, 16), (RIGHT, 16))]
    agents = [mobee.CuriousAgent(space, plant, seed=SEED) for space in spaces]
    mobee.run(agents, 30)
    watch = Stopwatch(plant)
    with watch.running():
        mobee.run(agents, transitions)
    return watch.pace(transitions)


def trajectory_hash(actions: int) -> str:
    """Return the hash of the trajectory that a new plant makes in `one_arm` with this number of actions; equal runs have equal hashes."""
    plant = arm_plant(hashed=True)
    one_arm(plant, actions)
    return plant.hash


class Batch:
    """Several plants of one robot, each with its own empty world and one arm, which moves to random states.

    The states are those of a lattice of 256 postures of the arm.  `count`: number of plants.
    """

    def __init__(self, body: Robot, count: int = PLANTS) -> None:
        self.plants = [OfflinePlant(Model(body), SEED + k, Gains.published_2014(), dt=DT, active=LEFT) for k in range(count)]
        self._space, self._rng = Lattice(body, LEFT, LEVELS), np.random.default_rng(SEED)

    def alone(self, actions: int) -> Pace:
        """Measure `actions` actions of each plant, where the plants act one after the other."""
        return self._timed(actions, lambda goals: [plant.act("left_arm", goal) for plant, goal in zip(self.plants, goals, strict=True)])

    def together(self, actions: int, threads: int = 1) -> Pace:
        """Measure `actions` actions of each plant, where all plants advance together in one batch.  `threads`: number of threads."""
        return self._timed(actions, lambda goals: self._advance(goals, threads))

    def _advance(self, goals: Sequence[Any], threads: int) -> None:
        for plant, goal in zip(self.plants, goals, strict=True):
            plant.begin("left_arm", goal)
        advance_together(self.plants, threads)

    def _timed(self, actions: int, act: Callable[[Sequence[Any]], object]) -> Pace:
        states = self._rng.integers(len(self._space), size=(actions, len(self.plants)))
        goals = [[self._space.target(int(state)) for state in row] for row in states]
        watch = Stopwatch(*self.plants)
        with watch.running():
            for row in goals:
                act(row)
        return watch.pace(states.size)


def measure_batch(actions: int, rounds: int) -> dict[str, Any]:
    """Compare a batch of plants with one plant alone, and two threads with one thread, in the same rounds.

    `actions`: number of actions of each plant of the batch in a round; the plant alone makes as many as the whole batch.

    Keys: "plants", their number; "alone" and "together", each with "us_per_tick" and "ticks_per_second"; "ratio", the batch's ticks per
    second of processor time, divided by those of the plant alone; "two_threads", the batch's ticks per second of wall time on two threads,
    divided by those on one thread, or None if two cores are not available.  All are medians of the rounds.
    """
    body = robot()
    one, many, shared = Batch(body, 1), Batch(body), Batch(body)
    for batch in (many, shared):
        batch.together(1)
    one.alone(actions)
    pairs, walls = [], []
    with Progress() as progress:
        with one_core():
            for number in range(rounds):
                progress.show(0.5 * number / rounds, f"{PLANTS} plants in a batch")
                pairs.append((one.alone(actions * PLANTS), many.together(actions)))
        with some_cores(2) as cores:
            for number in range(rounds if len(cores) == 2 else 0):
                progress.show(0.5 + 0.5 * number / rounds, f"{PLANTS} plants, two threads")
                walls.append((many.together(actions), shared.together(actions, threads=2)))
    rates = [[_tick_rates(one) for one in pair] for pair in pairs]
    found = {name: medians([pair[place] for pair in rates]) for place, name in enumerate(("alone", "together"))}
    ratio = [together["ticks_per_second"] / alone["ticks_per_second"] for alone, together in rates]
    gains = [two.ticks / two.wall_seconds / (single.ticks / single.wall_seconds) for single, two in walls]
    return {"plants": PLANTS, **found, "ratio": float(np.median(ratio)), "two_threads": float(np.median(gains)) if gains else None}


def _tick_rates(pace: Pace) -> dict[str, float]:
    return {"us_per_tick": 1e6 * pace.seconds / pace.ticks, "ticks_per_second": pace.ticks / pace.seconds}


def batch_text(result: dict[str, Any]) -> str:
    """Return the result of `measure_batch` as text."""
    alone, together = (result[name]["us_per_tick"] for name in ("alone", "together"))
    threads = "not measured on one core" if result["two_threads"] is None else f"{result['two_threads']:.2f} x the ticks a second"
    return (
        f"{result['plants']} plants in a batch: {together:.3f} us a tick, one alone {alone:.3f}; {result['ratio']:.2f} x the ticks\n"
        f"a second of processor time; two threads against one: {threads}."
    )
