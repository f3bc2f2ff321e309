# SPDX-License-Identifier: Apache-2.0
"""Planning: how exact and fast value iteration is, compared with exact policy iteration, SciPy's sparse matrices and quantecon."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from experiments.bench.peers import QUANTECON, DecisionProblem, load_quantecon
from experiments.bench.timing import Contestant, cores_text, one_core, rates
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress
from experiments.kit.learning.arm import arm_space
from mobee import CuriousAgent
from mobee.arrays import Array, Ints
from mobee.learning.tabular import TabularPlant, half_space
from mobee.learning.value_iteration import policy_iteration, value_iteration

DISCOUNT, TOLERANCE = 0.9, 1e-3  # published
MODEL_CHANGES = "changes of the model alone"  # subtracted from the time of the warm plans between them
COLD, WARM, ALGORITHM_7, SCIPY = "ours, cold", "ours, warm", "ours, Algorithm 7, cold", "SciPy sparse, cold"
PEERS = {"scipy": SCIPY, "quantecon": QUANTECON["value_iteration"]}
LARGE_STATES = 100_000
METHODS: tuple[Literal["jacobi", "modified"], ...] = ("jacobi", "modified")
ACTIONS = 16
MAX_STATE_STEP = 64  # how far in number an action of a problem of any size leads

REQUIREMENTS = (
    Requirement("largest difference from policy iteration", ("difference",), at_most=1e-9),
    Requirement("largest residual, in units of the tolerance", ("residual",), at_most=1.0),
    Requirement("cold, times faster than SciPy", ("cold_times_scipy",), at_least=6.0),
    Requirement("cold, times faster than quantecon", ("cold_times_quantecon",), at_least=8.0),
    Requirement("warm, times faster than SciPy", ("warm_times_scipy",), at_least=15.0),
    Requirement("warm, times faster than quantecon", ("warm_times_quantecon",), at_least=20.0),
    Requirement(f"cold with {LARGE_STATES} states, times SciPy", ("large_times_scipy",), at_least=1.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `problems`: number of random problems.  `rounds`: repetitions of the timing.  `observations`: number of observations of the agent; a
    warm plan, which starts from the values of the plan before, is timed after each.  `large`: number of states of the large problem.
    `large_rounds`: repetitions with it.
    """

    problems: int = 1000
    rounds: int = 15
    observations: int = 100  # of the agent, a warm plan after each
    large: int = LARGE_STATES
    large_rounds: int = 5


QUICK = Settings(problems=50, rounds=3, observations=50, large_rounds=1)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises NotInstalled without quantecon.

    Main keys: "us", a dict from a solver to the median processor time of a plan [us]; "cold_times_scipy", "warm_times_scipy",
    "cold_times_quantecon" and "warm_times_quantecon", the time of SciPy or quantecon divided by the time of our plan (a cold plan starts
    from zero values, a warm plan from the values of the plan before); "difference", largest relative difference from policy iteration;
    "residual", largest Bellman residual in units of the tolerance; "requirements", a list with the dict that `Requirement.judge` returns
    for each requirement; "passed", whether all are met.
    """
    load_quantecon()
    with one_core() as core, Progress() as progress:
        errors = []
        for number in range(settings.problems):
            if number % 10 == 0:
                progress.show(0.4 * number / settings.problems, "random problems")
            errors.append(_errors(number))
        progress.show(0.4, "81 states, 16 actions")
        known = after_transitions(1000, settings.observations)
        found = {name: 1e6 / values for name, values in rates(contestants(known), settings.rounds).items()}
        found[WARM] -= found.pop(MODEL_CHANGES)
        progress.show(0.8, f"{settings.large} states")
        large = {name: 1.0 / values for name, values in rates(large_contestants(settings.large), settings.large_rounds).items()}
    differences, residuals = zip(*errors, strict=True)
    result: dict[str, Any] = {"problems": settings.problems, "difference": max(differences), "residual": max(residuals)}
    result |= {"core": core, "rounds": settings.rounds, "us": {name: float(np.median(values)) for name, values in found.items()}}
    for key, peer in PEERS.items():
        result |= {f"{ours}_times_{key}": float(np.median(found[peer] / found[name])) for ours, name in (("cold", COLD), ("warm", WARM))}
    result |= {"large_seconds": {name: float(np.median(values)) for name, values in large.items()}}
    result["large_times_scipy"] = float(np.median(large[SCIPY] / large[COLD]))
    return result | verdict(result, REQUIREMENTS)


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: the times of all solvers, then the requirements."""
    lines = [
        f"81 states, 16 actions, discount {DISCOUNT}, tolerance {TOLERANCE}; processor time",
        f"{cores_text(result['core'])}, medians of {result['rounds']} rounds, in us a plan:",
    ]
    lines += [f"  {name:<40}{us:10.1f}" for name, us in result["us"].items()]
    large = ", ".join(f"{name} {seconds:.2f}" for name, seconds in result["large_seconds"].items())
    lines += [f"{LARGE_STATES} states, in s: {large}", f"{result['problems']} random problems, both methods, and requirements:"]
    return report_text(lines, result)


@dataclass(frozen=True, slots=True)
class Row:
    """The entries of one state-action in the tables of a decision problem.

    `outcomes`, `probabilities`: (B,), the next states and their probabilities.  `reward`: of the state-action.
    """

    state: int
    action: int
    outcomes: Ints
    probabilities: Array
    reward: float


@dataclass(frozen=True, slots=True)
class Tables:
    """The tables of a decision problem (MDP) with S states, A actions of each state, and B possible outcomes of each action.

    `outcomes` (S, A, B): the next states; several entries may be unused (probability 0); `probabilities` (S, A, B); `reward` (S, A).
    """

    outcomes: Ints
    probabilities: Array
    reward: Array

    def row(self, state: int, action: int) -> Row:
        """Return a copy of the entries of one state-action, which `put` can restore later."""
        at = state, action
        return Row(state, action, self.outcomes[at].copy(), self.probabilities[at].copy(), float(self.reward[at]))

    def put(self, row: Row) -> None:
        """Replace the entries of one state-action in place, as a new observation does."""
        at = row.state, row.action
        self.outcomes[at], self.probabilities[at], self.reward[at] = row.outcomes, row.probabilities, row.reward


@dataclass(frozen=True, slots=True)
class ChangingProblem:
    """A decision problem and a sequence of changes, each of which replaces the entries of one state-action.

    `changes`: the changes by some observations, then the reversals of these changes in reverse order, so that all together restore
    `tables`.
    """

    tables: Tables
    changes: tuple[Row, ...]

    def apply_changes(self) -> None:
        """Make all changes in order, in place.  The last ones undo the first ones, so that the tables are as before."""
        for change in self.changes:
            self.tables.put(change)


def with_changes(tables: Tables, observations: Iterable[Row]) -> ChangingProblem:
    """Return the problem `tables` with changes: each row of `observations` in order, then the original rows in reverse order."""
    forward, back = [], []
    for row in observations:
        forward.append(row)
        back.append(tables.row(row.state, row.action))
        tables.put(row)
    for row in reversed(back):
        tables.put(row)
    return ChangingProblem(tables, (*forward, *reversed(back)))


def random_problem(seed: int) -> tuple[Tables, float]:
    """Return a random decision problem and a discount factor, both drawn with `seed`.

    The problem has unused outcomes (probability 0), positive and negative rewards, actions that do not exist (reward -inf, or no outcome),
    and states without any action.
    """
    rng = np.random.default_rng(seed)
    shape = tuple(int(rng.integers(2, high)) for high in (40, 9, 7))
    weights = rng.exponential(size=shape) * (rng.random(shape) < 0.7)
    weights[rng.random(shape[0]) < 0.1] = 0.0
    reward = rng.choice([0.01, 1.0, 100.0]) * rng.normal(loc=rng.choice([-2.0, 0.0, 2.0]), size=shape[:2])
    reward[rng.random(shape[:2]) < 0.1] = -np.inf
    totals = weights.sum(axis=-1, keepdims=True)
    tables = Tables(rng.integers(shape[0], size=shape), weights / np.where(totals > 0.0, totals, 1.0), reward)
    return tables, float(rng.choice([0.0, 0.5, 0.9, 0.99]))


def problem_of_size(states: int, observations: int = 3, seed: int = 0) -> ChangingProblem:
    """Return a random decision problem with this number of states, and changes of it.

    Each state has 16 actions to goals whose numbers differ from its own by at most 64 (MAX_STATE_STEP), modulo the number of states.  An
    action has three outcomes: the goal, the same state, or the state numbered one higher than the goal.  Each of the `observations` changes
    replaces the entries of action 0 in a random state.  `seed`: of the random numbers.
    """
    rng = np.random.default_rng(seed)
    goals = (np.arange(states)[:, None] + rng.integers(-MAX_STATE_STEP, MAX_STATE_STEP + 1, (states, ACTIONS))) % states
    stay = np.broadcast_to(np.arange(states)[:, None], goals.shape)
    outcomes = np.stack([stay, goals, (goals + 1) % states], axis=-1)
    tables = Tables(outcomes, rng.dirichlet([1.0, 8.0, 0.5], goals.shape), 0.02 * rng.exponential(size=goals.shape))
    certain, some = np.array([0.1, 0.8, 0.1]), rng.integers(states, size=observations).tolist()
    return with_changes(tables, [Row(s, 0, outcomes[s, 0], certain, 0.5 * float(tables.reward[s, 0])) for s in some])


def after_transitions(transitions: int, observations: int, seed: int = 0) -> ChangingProblem:
    """Return the transition model that a curious agent has learned after `transitions` transitions, and changes of it.

    Each of the agent's next `observations` observations changes the entries of one state-action.  The new entries are those that the model
    has after all these observations.  The agent moves an arm with 81 states and 16 actions per state.  `seed`: of agent and plant.
    """
    space = arm_space(neighbours=ACTIONS)
    agent = CuriousAgent(space, TabularPlant(space, *half_space(space), seed=seed), seed=seed)
    agent.run(transitions)
    before, rows = _tables_of(agent), []
    for _ in range(observations):
        agent.step()
        rows.append(agent.last)
    bins = agent.model.outcomes.shape[2]
    known = _tables_of(agent)
    wider = ((0, 0), (0, 0), (0, bins - before.outcomes.shape[2]))
    before = Tables(np.pad(before.outcomes, wider), np.pad(before.probabilities, wider), before.reward)
    return with_changes(before, [known.row(one.s, one.a) for one in rows if one is not None])


def _tables_of(agent: CuriousAgent) -> Tables:
    return Tables(agent.model.outcomes.copy(), agent.model.probabilities.copy(), agent.model.reward.copy())


def contestants(problem: ChangingProblem, discount: float = DISCOUNT, repeats: int = 20) -> dict[str, Contestant]:
    """Return a dict from the name of each solver to a contestant, whose `run` repeats the solver's work `repeats` times.

    "ours, warm" plans after each change of the problem and starts from the values of the plan before.  "changes of the model alone" makes
    the same changes without planning, so that their time can be subtracted.  The other solvers plan for the unchanged problem.  Raises
    ArithmeticError if the values of SciPy or quantecon differ from the exact ones by more than the tolerance allows.  `discount`: factor of
    future rewards.
    """
    first = problem.tables
    peer = DecisionProblem(first, first.reward, discount, TOLERANCE)
    theirs = peer.quantecon()
    exact, _ = value_iteration(first, first.reward, discount, 1e-9, method="modified")
    peers = {SCIPY: peer.scipy_values} | {name: partial(peer.quantecon_values, theirs, method) for method, name in QUANTECON.items()}
    limit = 2.0 * TOLERANCE * discount / (1.0 - discount)  # each is within half of it of the exact values
    for name, solve in peers.items():
        error = np.abs(solve() - exact).max()
        if error > limit:
            raise ArithmeticError(f"{name} is wrong by {error:.3g}, which is more than {limit:.3g}.")
    solvers: dict[str, tuple[Callable[[], object], int]] = {
        COLD: (partial(_plan_cold, first, discount), 1),
        WARM: (partial(_plan_warm, problem, exact, discount), len(problem.changes)),
        MODEL_CHANGES: (problem.apply_changes, len(problem.changes)),
        ALGORITHM_7: (partial(value_iteration, first, first.reward, discount, TOLERANCE), 1),
        **{name: (solve, 1) for name, solve in peers.items()},
    }
    return {name: Contestant(partial(_repeat, solve, repeats), repeats * plans) for name, (solve, plans) in solvers.items()}


def large_contestants(states: int) -> dict[str, Contestant]:
    """Return two contestants, our solver and SciPy, for one problem with this number of states.

    The `run` of each makes one plan, which starts from zero values.
    """
    tables = problem_of_size(states).tables
    peer = DecisionProblem(tables, tables.reward, DISCOUNT, TOLERANCE)
    return {COLD: Contestant(lambda: _plan_cold(tables), 1), SCIPY: Contestant(peer.scipy_values, 1)}


def _repeat(solve: Callable[[], object], times: int) -> None:
    for _ in range(times):
        solve()


def _plan_cold(tables: Tables, discount: float = DISCOUNT) -> tuple[Array, Array]:
    return value_iteration(tables, tables.reward, discount, TOLERANCE, method="modified")


def _plan_warm(problem: ChangingProblem, values: Array, discount: float) -> None:
    tables = problem.tables
    for change in problem.changes:
        tables.put(change)
        values, _ = value_iteration(tables, tables.reward, discount, TOLERANCE, values, method="modified")


def _errors(seed: int) -> tuple[float, float]:
    """Return two errors of value iteration on a random problem, each the larger one of both METHODS.

    The first is the largest difference of state values and action values from exact policy iteration, divided by the largest exact absolute
    value or by 1 if that is larger.  The second is the Bellman residual after a run with TOLERANCE, divided by TOLERANCE.
    """
    tables, discount = random_problem(seed)
    exact, exact_actions = policy_iteration(tables, tables.reward, discount)
    exists, size = np.isfinite(exact_actions), float(np.abs(exact).max(initial=1.0))
    difference = residual = 0.0
    for method in METHODS:
        values, found = value_iteration(tables, tables.reward, discount, 1e-12, relative=True, method=method)
        error = max(np.abs(values - exact).max(), np.abs(found[exists] - exact_actions[exists]).max(initial=0.0))
        difference = max(difference, float(error) / size)
        values, _ = value_iteration(tables, tables.reward, discount, TOLERANCE, method=method)
        residual = max(residual, _residual(tables, exists, discount, values) / TOLERANCE)
    return difference, residual


def _residual(tables: Tables, exists: Array, discount: float, values: Array) -> float:
    """Return the sup-norm Bellman residual over the states that have actions."""
    onwards = (tables.probabilities * values[tables.outcomes]).sum(axis=-1)
    acting = exists.any(axis=1)
    best = np.where(exists, tables.reward + discount * onwards, -np.inf)[acting].max(axis=1)
    return float(np.abs(best - values[acting]).max(initial=0.0))
