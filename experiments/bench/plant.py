"""How fast the offline plant is, beside MuJoCo's stepper on the same model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bench import calibration, plant_batch
from experiments.bench import verdicts as requirement
from experiments.bench.calibration import Calibration
from experiments.bench.mujoco_peer import load_mujoco, us_per_tick
from experiments.bench.plant_workload import DT, Pace, arm_plant, one_arm, one_arm_reaching, three_agents, trajectory_hash
from experiments.bench.verdicts import judged, one_core
from experiments.kit.command_line import Progress

# Name, which run, which number of it in the standard machine's time, at least, aim.
REQUIREMENTS = (
    ("one arm, times real time", "one_arm", "times_real_time", 9000.0, 24_000.0),
    ("one arm, actions/s", "one_arm", "actions_per_second", 1400.0, 3700.0),
    ("one arm reaching, times real time", "reaching", "times_real_time", 6000.0, 16_000.0),
    ("three agents at the table, transitions/s", "three_agents", "actions_per_second", 1500.0, 4200.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is run."""

    actions: int = 1000
    reaches: int = 500
    transitions: int = 3000
    hashed: int = 50
    ticks: int = 5000  # of MuJoCo
    batched: int = 20  # actions of each plant of a batch
    rounds: int = 3  # the median counts


QUICK = Settings(actions=100, reaches=50, transitions=300, hashed=10, ticks=500, batched=2, rounds=1)


def measure(settings: Settings) -> dict[str, Any]:
    """All numbers, for people and scripts; raises MujocoMissing."""
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
    result: dict[str, Any] = {name: _median(rounds) for name, rounds in found.items()}
    result |= {"tick": DT, "core": core, "rounds": settings.rounds, "speed": speeds.median}
    result |= {"mujoco_us_per_tick": float(np.median(mujoco)), "times_mujoco": float(np.median(ratios))}
    result["batch"] = plant_batch.measure(settings.batched, max(5, settings.rounds) if settings.rounds > 1 else 1)
    return result | verdict(result, hashes[0] == hashes[1])


def verdict(result: Mapping[str, Any], same_hash: bool) -> dict[str, Any]:
    """Whether it is as fast as required, and repeats itself."""
    required = [judged(name, result[run][f"standard_{key}"], at_least=least, aim=aim) for name, run, key, least, aim in REQUIREMENTS]
    batch = f"{result['batch']['plants']} plants in a batch, times one alone"
    required.append(judged(batch, result["batch"]["ratio"], at_least=plant_batch.LEAST))
    return {"requirements": required, "same_hash": same_hash, "passed": same_hash and requirement.all_passed(required)}


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        f"Ticks of {1e3 * result['tick']:g} ms, motor substeps of 5 ms; processor time",
        f"{'of one core' if result['core'] is not None else '(not pinned to a core)'}, rounds: {result['rounds']} (the median counts).",
        f"{'':<32}{'x real time':>12}{'ended/s':>10}{'us/tick':>9}{'s/action':>10}",
    ]
    titles = {"one_arm": "one arm, 256 states", "reaching": "one arm, reaching", "three_agents": "three agents at the table"}
    for name, title in titles.items():
        one = result[name]
        lines.append(
            f"{title:<32}{one['times_real_time']:>12.0f}{one['actions_per_second']:>10.0f}{one['us_per_tick']:>9.2f}"
            f"{one['seconds_per_action']:>10.2f}"
        )
    lines.append(
        f"MuJoCo's stepper, one arm: {result['mujoco_us_per_tick']:.1f} us a tick, {result['times_mujoco']:.1f} times ours. It solves\n"
        "rigid-body dynamics and contact, which our motors do not have; it has no model,\nlaw or encoders."
    )
    lines.append(plant_batch.told(result["batch"]))
    lines += [calibration.told(result["speed"]), *requirement.lines(result["requirements"])]
    return "\n".join([*lines, f"  same seed, same trajectory hash: {'yes' if result['same_hash'] else 'NO'}"])


def _median(rounds: list[dict[str, float]]) -> dict[str, float]:
    return {key: float(np.median([one[key] for one in rounds])) for key in rounds[0]}
