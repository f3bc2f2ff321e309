# SPDX-License-Identifier: Apache-2.0
"""The Gymnasium environments of MoBeE compared with Gymnasium's own MuJoCo environments: steps per second, alone and 64 in a batch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from experiments.bench.peers import import_peer
from experiments.bench.timing import Calibration, cores_text, one_core, processor_time
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress

BATCH = 64
REACH, REACH_BATCH, LATTICE, LATTICE_BATCH = "Reach, one", f"Reach, {BATCH} together", "Lattice, one", f"Lattice, {BATCH} together"
REACHER, HUMANOID = "Reacher-v5 of Gymnasium", "Humanoid-v5 of Gymnasium"
UNITS = {
    REACH: "10 ticks",
    REACH_BATCH: "10 ticks",
    LATTICE: "an action",
    LATTICE_BATCH: "an action",
    REACHER: "2 ticks",
    HUMANOID: "5 ticks",
}

REQUIREMENTS = (
    Requirement("Reach-v0, one, steps/s", ("standard", REACH), at_least=2000.0),
    Requirement(f"Reach-v0, {BATCH} in a batch, steps/s", ("standard", REACH_BATCH), at_least=20_000.0),
    Requirement("Lattice-v0, one, whole actions/s", ("standard", LATTICE), at_least=2000.0),
    Requirement("Reach-v0 in a batch, times Humanoid-v5", ("times_humanoid",), at_least=2.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `steps`: number of steps of each player in a round, as in `players`.  `rounds`: number of rounds, of which the median is reported.
    """

    steps: int = 500
    rounds: int = 7  # the median counts


QUICK = Settings(steps=100, rounds=2)


class Player:
    """Performs random actions, drawn in advance, in a Gymnasium environment or in a vector of environments."""

    def __init__(self, env: Any, steps: int) -> None:
        self._env, self._count = env, getattr(env, "num_envs", 1)
        env.reset(seed=0)
        env.action_space.seed(0)
        self._actions = [env.action_space.sample() for _ in range(max(1, steps // self._count))]

    @property
    def steps(self) -> int:
        """The number of steps in one `run`, summed over all environments of a vector."""
        return len(self._actions) * self._count

    def run(self) -> None:
        """Perform all actions.  A single environment is reset when its episode ends; a vector resets its environments itself."""
        for action in self._actions:
            _, _, over, cut, _ = self._env.step(action)
            if self._count == 1 and (over or cut):
                self._env.reset()


def players(steps: int) -> dict[str, Player]:
    """Return a dict from the name of each environment (a key of UNITS) to a player.

    `steps`: number of steps of each player in a run, summed over the environments of a vector; the vector of Reach-v0 makes four times as
    many.  Raises NotInstalled without Gymnasium, MuJoCo or imageio.
    """
    gymnasium = import_peer("gymnasium", "Gymnasium")
    for package, name in (("mujoco", "MuJoCo"), ("imageio", "imageio, which Gymnasium's MuJoCo environments import")):
        import_peer(package, name)
    import_peer("mobee.gymnasium", "Gymnasium")
    made = {
        REACH: gymnasium.make("MoBeE/Reach-v0"),
        REACH_BATCH: gymnasium.make_vec("MoBeE/Reach-v0", num_envs=BATCH),
        LATTICE: gymnasium.make("MoBeE/Lattice-v0"),
        LATTICE_BATCH: gymnasium.make_vec("MoBeE/Lattice-v0", num_envs=BATCH),
        REACHER: gymnasium.make("Reacher-v5"),
        HUMANOID: gymnasium.make("Humanoid-v5"),
    }
    return {name: Player(env, steps * (4 if name == REACH_BATCH else 1)) for name, env in made.items()}


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises NotInstalled without Gymnasium, MuJoCo or imageio.

    Main keys: "steps_per_second", and "standard" for the same rates on the standard machine (the one for which the requirements were set),
    both dicts from the name of an environment to the median of the rounds; "times_humanoid" and "times_reacher", rate of the batch of
    Reach-v0 over that of Gymnasium's Humanoid-v5 and Reacher-v5; "requirements", a list with the dict that `Requirement.judge` returns for
    each requirement; "passed", whether all are met.
    """
    playing, speeds = players(settings.steps), Calibration()
    found: dict[str, list[float]] = {name: [] for name in playing}
    standard: dict[str, list[float]] = {name: [] for name in playing}
    with one_core() as core, Progress() as progress:
        for number in range(settings.rounds):
            for part, (name, player) in enumerate(playing.items()):
                progress.show((number + part / len(playing)) / settings.rounds, name)
                (_, seconds), speed = speeds.around(partial(processor_time, player.run))
                found[name].append(player.steps / seconds)
                standard[name].append(player.steps / seconds / speed)
    result: dict[str, Any] = {"core": core, "rounds": settings.rounds, "speed": speeds.median}
    result["steps_per_second"] = {name: float(np.median(rates)) for name, rates in found.items()}
    result["standard"] = {name: float(np.median(rates)) for name, rates in standard.items()}
    for key, peer in (("times_humanoid", HUMANOID), ("times_reacher", REACHER)):
        result[key] = float(np.median(np.array(found[REACH_BATCH]) / found[peer]))
    return result | verdict(result, REQUIREMENTS)


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each environment, then the requirements."""
    lines = [
        f"Random actions; processor time {cores_text(result['core'])},",
        f"rounds: {result['rounds']} (the median counts).",
        f"{'':<28}{'a step':>10}{'steps/s':>10}{'in standard time':>18}",
    ]
    for name, rate in result["steps_per_second"].items():
        lines.append(f"{name:<28}{UNITS[name]:>10}{rate:>10.0f}{result['standard'][name]:>18.0f}")
    lines.append(f"A batch of Reach-v0 beside Reacher-v5, two motors without contacts: {result['times_reacher']:.2f}")
    return report_text(lines, result)
