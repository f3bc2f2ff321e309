"""How right and how fast plans are: beside exact policy iteration, SciPy's sparse matrices and quantecon."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from experiments.bench import verdicts as requirement
from experiments.bench.verdicts import Contestant, judged, one_core, rates
from experiments.bench.vi_peers import QUANTECON, Problem, load_quantecon
from experiments.bench.vi_workload import Tables, Work, at_random, at_work, of_size
from experiments.kit.command_line import Progress
from mobee.arrays import Array
from mobee.learning.value_iteration import METHODS, policy_iteration, value_iteration

DISCOUNT, TOLERANCE = 0.9, 1e-3  # published
OBSERVING = "changes of the model alone"  # taken off the time of the warm plans between them
COLD, WARM, ALGORITHM_7, SCIPY = "ours, cold", "ours, warm", "ours, Algorithm 7, cold", "SciPy sparse, cold"
PEERS = (SCIPY, QUANTECON["value_iteration"])
LARGE = 100_000  # states

# Name, key of the result, at least or at most, bound.
REQUIREMENTS = (
    ("largest difference from policy iteration", "difference", "most", 1e-9),
    ("largest residual, in units of the tolerance", "residual", "most", 1.0),
    ("cold, times faster than SciPy", "cold_times_scipy", "least", 6.0),
    ("cold, times faster than quantecon", "cold_times_quantecon", "least", 8.0),
    ("warm, times faster than SciPy", "warm_times_scipy", "least", 15.0),
    ("warm, times faster than quantecon", "warm_times_quantecon", "least", 20.0),
    (f"cold with {LARGE} states, times SciPy", "large_times_scipy", "least", 1.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is solved."""

    problems: int = 1000
    rounds: int = 15
    observations: int = 100  # of the agent, a warm plan after each
    large: int = LARGE
    large_rounds: int = 5


QUICK = Settings(problems=50, rounds=3, observations=50, large_rounds=1)


def measure(settings: Settings) -> dict[str, Any]:
    """All numbers, for people and scripts; raises QuanteconMissing."""
    load_quantecon()
    with one_core() as core, Progress() as progress:
        differences, residuals = [], []
        for number in range(settings.problems):
            if number % 10 == 0:
                progress.show(0.4 * number / settings.problems, "random problems")
            difference, residual = _checked(number)
            differences.append(difference)
            residuals.append(residual)
        progress.show(0.4, "81 states, 16 actions")
        found = {name: 1e6 / values for name, values in rates(contestants(at_work(1000, settings.observations)), settings.rounds).items()}
        found[WARM] -= found.pop(OBSERVING)
        progress.show(0.8, f"{settings.large} states")
        large = {name: 1.0 / values for name, values in rates(large_contestants(settings.large), settings.large_rounds).items()}
    result: dict[str, Any] = {"problems": settings.problems, "difference": max(differences), "residual": max(residuals)}
    result |= {"core": core, "rounds": settings.rounds, "us": {name: float(np.median(values)) for name, values in found.items()}}
    for key, peer in zip(("scipy", "quantecon"), PEERS, strict=True):
        result |= {f"{ours}_times_{key}": float(np.median(found[peer] / found[name])) for ours, name in (("cold", COLD), ("warm", WARM))}
    result |= {"large_seconds": {name: float(np.median(values)) for name, values in large.items()}}
    result["large_times_scipy"] = float(np.median(large[SCIPY] / large[COLD]))
    return result | verdict(result)


def verdict(result: Mapping[str, Any]) -> dict[str, Any]:
    """Whether plans are as right, and as fast beside the peers, as required."""
    required = [judged(name, result[key], **{f"at_{sense}": bound}) for name, key, sense, bound in REQUIREMENTS]
    return {"requirements": required, "passed": requirement.all_passed(required)}


def contestants(work: Work, discount: float = DISCOUNT, repeats: int = 20) -> dict[str, Contestant]:
    """Every solver of a problem; ours warm after each change of it, from the values before."""
    first = work.tables
    peer = Problem(first, first.reward, discount, TOLERANCE)
    theirs = peer.quantecon()
    exact, _ = value_iteration(first, first.reward, discount, 1e-9, method="modified")
    peers = {SCIPY: peer.scipy_values} | {name: partial(peer.quantecon_values, theirs, method) for method, name in QUANTECON.items()}
    limit = 2.0 * TOLERANCE * discount / (1.0 - discount)  # each is within half of it of the truth
    for name, solve in peers.items():
        off = np.abs(solve() - exact).max()
        if off > limit:
            raise ArithmeticError(f"{name} is wrong by {off:.3g}, which is more than {limit:.3g}.")
    ours = {
        COLD: partial(_cold, first, discount),
        WARM: partial(_warm, work, exact, discount),
        OBSERVING: partial(_observe, work),
        ALGORITHM_7: partial(value_iteration, first, first.reward, discount, TOLERANCE),
    }
    return {
        name: Contestant(partial(_repeat, solve, repeats), repeats * (len(work.changes) if name in (WARM, OBSERVING) else 1))
        for name, solve in (ours | peers).items()
    }


def large_contestants(states: int) -> dict[str, Contestant]:
    """One cold plan of a large problem: ours, and SciPy's."""
    tables = of_size(states).tables
    peer = Problem(tables, tables.reward, DISCOUNT, TOLERANCE)
    return {COLD: Contestant(lambda: _cold(tables), 1), SCIPY: Contestant(peer.scipy_values, 1)}


def _repeat(solve: Callable[[], object], times: int) -> None:
    for _ in range(times):
        solve()


def _cold(tables: Tables, discount: float = DISCOUNT) -> tuple[Array, Array]:
    return value_iteration(tables, tables.reward, discount, TOLERANCE, method="modified")


def _warm(work: Work, start: Array, discount: float) -> None:
    tables = work.tables
    for change in work.changes:
        tables.put(change)
        start, _ = value_iteration(tables, tables.reward, discount, TOLERANCE, start, method="modified")


def _observe(work: Work) -> None:
    for change in work.changes:
        work.tables.put(change)


def _checked(seed: int) -> tuple[float, float]:
    """Of a random problem: the difference from policy iteration over the largest value, and the residual over the tolerance."""
    tables, discount = at_random(seed)
    exact, exact_actions = policy_iteration(tables, tables.reward, discount)
    exists, size = np.isfinite(exact_actions), float(np.abs(exact).max(initial=1.0))
    difference = residual = 0.0
    for method in METHODS:
        values, found = value_iteration(tables, tables.reward, discount, 1e-12, relative=True, method=method)
        off = max(np.abs(values - exact).max(), np.abs(found[exists] - exact_actions[exists]).max(initial=0.0))
        difference = max(difference, float(off) / size)
        values, _ = value_iteration(tables, tables.reward, discount, TOLERANCE, method=method)
        residual = max(residual, _residual(tables, exists, discount, values) / TOLERANCE)
    return difference, residual


def _residual(tables: Tables, exists: Array, discount: float, values: Array) -> float:
    """The sup-norm Bellman residual over the states that have actions."""
    onwards = (tables.probabilities * values[tables.outcomes]).sum(axis=-1)
    acting = exists.any(axis=1)
    best = np.where(exists, tables.reward + discount * onwards, -np.inf)[acting].max(axis=1)
    return float(np.abs(best - values[acting]).max(initial=0.0))


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        f"81 states, 16 actions, discount {DISCOUNT}, tolerance {TOLERANCE}; processor time",
        f"{'of one core' if result['core'] is not None else '(not pinned to a core)'}, medians of {result['rounds']} rounds, in us a plan:",
    ]
    lines += [f"  {name:<40}{us:10.1f}" for name, us in result["us"].items()]
    large = ", ".join(f"{name} {seconds:.2f}" for name, seconds in result["large_seconds"].items())
    lines += [f"{LARGE} states, in s: {large}", f"{result['problems']} random problems, both methods, and requirements:"]
    return "\n".join([*lines, *requirement.lines(result["requirements"])])
