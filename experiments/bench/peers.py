# SPDX-License-Identifier: Apache-2.0
"""Programs of other authors, for comparison: how to import them, a strategy with CMA-ES, precise searches of coal, and solvers of MDPs."""

from __future__ import annotations

import importlib
import warnings
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from mobee.arrays import Array
from mobee.errors import NotInstalled
from mobee.learning.value_iteration import OutcomeModel


def import_peer(module: str, name: str, extra: str = "bench") -> Any:
    """Import the optional module `module` and return it; raises NotInstalled if it is missing.

    `name`, `extra`: name of the package, and the extra of MoBeE that installs it, for the message of the error.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise NotInstalled(f'{name} is not installed: pip install "mobee[{extra}]"') from None


def load_cma() -> Any:
    """Return the imported package cma (CMA-ES by its authors); raises NotInstalled if it is missing."""
    return import_peer("cma", "cma")


class CmaStrategy:
    """CMA-ES with its default settings and the interface of the library's strategies.

    `ask` returns a generation of samples, and `tell` takes their costs.

    Args:
        start: mean of the first generation (d,).
        std: standard deviation of the first generation.
        seed: of the random numbers.
        population: samples of a generation; None: CMA-ES chooses.
        limits: lower and upper limit of every coordinate; None: no limits.
    """

    def __init__(
        self, start: Array, std: float, seed: int, population: int | None = None, limits: tuple[float, float] | None = None
    ) -> None:
        """Make the strategy.  `limits`: lower and upper limit of every coordinate; None: no limits.  Raises NotInstalled without cma."""
        options: dict[str, Any] = {"seed": seed + 1, "verbose": -9, "bounds": limits or [None, None]}  # its seed 0 means the time of day
        if population is not None:
            options["popsize"] = population
        self._strategy = load_cma().CMAEvolutionStrategy(start, std, options)
        self._asked: list[Array] = []

    def ask(self) -> Array:
        """Return the samples of the next generation, (population, d)."""
        self._asked = self._strategy.ask()
        return np.array(self._asked)

    def tell(self, costs: Array) -> None:
        """Update the strategy by the costs (population,) of the samples that the last call of `ask` returned."""
        self._strategy.tell(self._asked, costs.tolist())

    @property
    def stopped(self) -> bool:
        """Whether a stopping criterion of CMA-ES itself is met."""
        return bool(self._strategy.stop())


# Of coal's iterative searches [m].  With 1e-6 or 1e-9 it misses contacts of cylinders, up to 46 mm deep (baxter), which polytopes inside
# of them and python-fcl confirm; its plain search misses contacts of some micrometres.
_COAL_TOLERANCE, _COAL_ITERATIONS, _COAL_SEARCH = 1e-12, 1000, "NesterovAcceleration"


def make_searches_precise(found: Any) -> None:
    """Set method, tolerances and iterations of coal's searches in `found` (Pinocchio's GeometryData), so that it misses no contact."""
    search = import_peer("coal", "coal", extra="dev").GJKVariant.names[_COAL_SEARCH]
    for request in found.distanceRequests:
        request.enable_signed_distance = True
    for request in (*found.distanceRequests, *found.collisionRequests):
        request.gjk_variant = search
        request.gjk_tolerance = request.epa_tolerance = _COAL_TOLERANCE
        request.gjk_max_iterations = request.epa_max_iterations = _COAL_ITERATIONS
        with warnings.catch_warnings():  # deprecated, but the setting that replaces it has no effect
            warnings.simplefilter("ignore", DeprecationWarning)
            request.enable_cached_gjk_guess = False  # started where the last pose's search ended, coal misses a contact of 1 mm


QUANTECON = {"value_iteration": "quantecon value iteration", "modified_policy_iteration": "quantecon modified policy iteration"}


def load_quantecon() -> Any:
    """Return quantecon's class DiscreteDP; raises NotInstalled if quantecon is missing."""
    return import_peer("quantecon.markov", "quantecon").DiscreteDP


class DecisionProblem:
    """A decision problem (MDP) in the form that SciPy and quantecon need: a sparse matrix with a row for each state-action.

    It is built before the timing begins.  Every state must have at least one action.  `rewards` (N,) and `following` (N, S) are the rewards
    and the transition probabilities of all N state-actions.  quantecon's policy iteration, which is exact, is not measured: it does not end
    if the values of two actions differ only by rounding errors.

    Args:
        model: transition model with S states.
        reward: (S, A), reward of each action; -inf where there is no action.
        discount: discount factor, 0 to 1.
        tolerance: largest change of an action's value in the last sweep of value iteration.
    """

    def __init__(self, model: OutcomeModel, reward: Array, discount: float, tolerance: float) -> None:
        self.discount, self.tolerance = discount, tolerance
        self.states, self.actions = np.nonzero(reward != -np.inf)
        self.rewards = np.ascontiguousarray(reward[self.states, self.actions])
        self.first = np.searchsorted(self.states, np.arange(len(reward)))
        weights, following = model.probabilities[self.states, self.actions], model.outcomes[self.states, self.actions]
        rows = np.repeat(np.arange(len(self.rewards)), weights.shape[1])
        self.following = csr_matrix((weights.ravel(), (rows, following.ravel())), shape=(len(self.rewards), len(reward)))
        self.following.eliminate_zeros()

    def scipy_values(self) -> Array:
        """Compute the values of the states (S,) by thesis Algorithm 7, with one product of SciPy's sparse matrix per sweep."""
        values, before = np.zeros(len(self.first)), np.zeros(len(self.rewards))
        while True:
            action_values = self.rewards + self.discount * (self.following @ values)
            values = np.maximum.reduceat(action_values, self.first)
            if np.abs(action_values - before).max() < self.tolerance:
                return values
            before = action_values

    def quantecon(self) -> Any:
        """Return the problem as an instance of quantecon's DiscreteDP."""
        return load_quantecon()(self.rewards, self.following, self.discount, self.states, self.actions)

    def quantecon_values(self, problem: Any, method: str) -> Array:
        """Compute the values of the states (S,) by quantecon.

        It starts from its own initial values, which are nearer to the solution than zeros.  Its value iteration stops by the same tolerance
        as ours.  `problem`: the result of `quantecon`.  `method`: a key of QUANTECON.
        """
        epsilon = 2.0 * self.discount / (1.0 - self.discount) * self.tolerance
        values: Array = problem.solve(method=method, epsilon=epsilon, max_iter=100_000).v
        return values
