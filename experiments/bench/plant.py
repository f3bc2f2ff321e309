"""How fast the offline plant is, beside MuJoCo's stepper on the same model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from experiments.bench.mujoco_peer import load_mujoco
from experiments.bench.mujoco_stepper import us_per_tick
from experiments.bench.plant_workload import DT, arm_plant, one_arm, one_arm_reaching, three_agents, trajectory_hash
from experiments.bench.rounds import one_core
from experiments.progress import Progress

# Name, which run, which number, at least, aim.
REQUIREMENTS = (
    ("one arm, times real time", "one_arm", "times_real_time", 2000.0, 5000.0),
    ("one arm, actions/s", "one_arm", "actions_per_second", 700.0, 1200.0),
    ("one arm reaching, times real time", "reaching", "times_real_time", 2000.0, 9000.0),
    ("three agents at the table, transitions/s", "three_agents", "actions_per_second", 1500.0, 3000.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is run."""

    actions: int = 1000
    reaches: int = 500
    transitions: int = 3000
    hashed: int = 50
    ticks: int = 5000  # of MuJoCo
    rounds: int = 3  # the median counts


QUICK = Settings(actions=100, reaches=50, transitions=300, hashed=10, ticks=500, rounds=1)


def measure(settings: Settings) -> dict[str, Any]:
    """All numbers, for people and scripts; raises MujocoMissing."""
    load_mujoco()
    found: dict[str, list[dict[str, float]]] = {"one_arm": [], "reaching": [], "three_agents": []}
    mujoco = []
    with one_core() as core, Progress() as progress:
        for number in range(settings.rounds):
            progress.show(number / settings.rounds, "one arm")
            found["one_arm"].append(one_arm(arm_plant(), settings.actions).numbers)
            progress.show((number + 0.3) / settings.rounds, "one arm, reaching")
            found["reaching"].append(one_arm_reaching(arm_plant(), settings.reaches).numbers)
            progress.show((number + 0.5) / settings.rounds, "three agents")
            found["three_agents"].append(three_agents(settings.transitions).numbers)
            progress.show((number + 0.9) / settings.rounds, "MuJoCo")
            mujoco.append(us_per_tick(arm_plant(), settings.ticks))
        hashes = [trajectory_hash(settings.hashed) for _ in range(2)]
    result: dict[str, Any] = {name: _median(rounds) for name, rounds in found.items()}
    result |= {"tick": DT, "core": core, "rounds": settings.rounds, "mujoco_us_per_tick": _middle(mujoco)}
    result["times_mujoco"] = result["mujoco_us_per_tick"] / result["one_arm"]["us_per_tick"]
    result["requirements"] = [_required(result, *one) for one in REQUIREMENTS]
    result["same_hash"] = hashes[0] == hashes[1]
    result["passed"] = result["same_hash"] and all(one["passed"] for one in result["requirements"])
    return result


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
    lines += [
        f"  {one['name']:<39}{one['found']:9.0f}, required {one['least']:g}, aim {one['aim']:g}  {'pass' if one['passed'] else 'SHORT'}"
        for one in result["requirements"]
    ]
    return "\n".join([*lines, f"  same seed, same trajectory hash: {'yes' if result['same_hash'] else 'NO'}"])


def _required(result: dict[str, Any], name: str, run: str, number: str, least: float, aim: float) -> dict[str, Any]:
    found = result[run][number]
    return {"name": name, "found": found, "least": least, "aim": aim, "passed": found >= least}


def _median(rounds: list[dict[str, float]]) -> dict[str, float]:
    return {key: _middle([one[key] for one in rounds]) for key in rounds[0]}


def _middle(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]
