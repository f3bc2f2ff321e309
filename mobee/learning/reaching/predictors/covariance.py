# SPDX-License-Identifier: Apache-2.0
"""The covariance function of the Gaussian process over reaches (pulls of the hand towards a target), and the fit of its parameters.

The covariance of the mean rewards of two reaches has four parts: for similar poses and near targets ("place"), for similar poses and
similar vectors from hand to target ("approach"), for similar remaining distances in any poses ("distance"), and a small part for all
reaches ("offset").

`LinearArm` predicts the distance that remains after a reach, with springs at the joints and a force at the hand. In a state with the
Jacobian J, a force proportional to the remaining error e turns the joints by g J^T e, against their springs. So for the vector w from hand
to target, e = (I + g J J^T)^-1 w. The compliance g is one number for all states, fitted to the rewards.

Reaches may be made in several worlds or on several robots, such as a simulated one; the similarity of the worlds is estimated from the
rewards. The mean reward of a reach in an earlier world is its mean reward in the present world plus a difference. The differences of one
world are a Gaussian process whose covariance function is that of the mean rewards, times a factor d. The differences of two worlds are
independent. So the covariance of the mean rewards of two reaches is K in general, and (1 + d) K if both were made in the same earlier
world. With d = 0 the rewards of that world count like those of the present one; the larger d is, the less the rewards of that world inform
about the present one. (Kennedy and O'Hagan 2000 model fast and accurate simulations like this, with another covariance function of the
differences.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.predictors.predictor import Reached
from mobee.learning.reaching.reaches import Reaches

OFFSET = 0.3**2  # variance of the common part of all rewards
DEFAULTS = {  # variances of rewards, which are in [0, 1], and lengths in m
    "noise": 0.05**2,
    "place": 0.2**2,
    "place length": 0.15,
    "approach": 0.2**2,
    "approach length": 0.10,
    "approach joints": 2.0,  # times the lengths of the joints
    "distance": 0.2**2,
    "distance length": 0.10,
}
DEFAULT_JOINT = 0.5  # length scale of each joint, in units of the spread of the samples
_NOISE, _PLACE, _PLACE_L, _APPROACH, _APPROACH_L, _APPROACH_J, _DISTANCE, _DISTANCE_L, _JOINTS = range(9)
Slopes = Callable[[Array], Array]

MAX_FITTED = 500  # pairs used in the fit: time grows with their cube
PRIOR_DEVIATION = 1.0  # of the logarithm of a parameter around its default
MAX_STEPS = 40  # of the search

COMPLIANCES = (0.0, 1.25, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0)  # rad/m^2, candidates of the fit
DEFAULT_COMPLIANCE = 20.0  # rad/m^2, before the first fit
SLOPE_WEIGHT = 1.0  # of slope 1 in the fit of the linear function, in reaches

ONE_WORLD = np.zeros(1)
"""The factors d if there is only the present world, (1,)."""
FACTORS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # values of d, equally probable before any reach


class Covariance:
    """The covariance function of the mean rewards of reaches, for given parameters.

    Args:
        squares: (d, S, S) scaled squared differences of d joints between S states, from `joint_squares`.
        logs: (8 + d,) logarithms of the parameters, in the order of `default_parameters`.
    """

    def __init__(self, squares: Array, logs: Array) -> None:
        self.logs = logs
        self._squares = squares
        self._value = np.exp(logs)
        lengths = self._value[_JOINTS:]
        far = np.tensordot(lengths**-2.0, squares, 1)
        self._by_place = self._value[_PLACE] * np.exp(-0.5 * far)
        self._by_approach = self._value[_APPROACH] * np.exp(-0.5 * far / self._value[_APPROACH_J] ** 2)

    @property
    def noise(self) -> float:
        """The variance of one reward around the mean reward of its reach."""
        return float(self._value[_NOISE])

    @property
    def prior(self) -> float:
        """The variance of the mean reward of a reach before any reach was observed."""
        return float(OFFSET + self._value[[_PLACE, _APPROACH, _DISTANCE]].sum())

    def between(self, a: Points, b: Points) -> Array:
        """Return the covariances of the mean rewards of n reaches `a` and m reaches `b`, shape (n, m).

        `a`, `b`: features of the reaches, such as their states and targets, from the function `points`.
        """
        pair = np.ix_(a.state, b.state)
        place = self._by_place[pair] * np.exp(_squared(a.target, b.target) * (-0.5 / self._value[_PLACE_L] ** 2))
        approach = self._by_approach[pair] * np.exp(_squared(a.vector, b.vector) * (-0.5 / self._value[_APPROACH_L] ** 2))
        distance = np.exp((a.remaining[:, None] - b.remaining) ** 2 * (-0.5 / self._value[_DISTANCE_L] ** 2))
        total: Array = place + approach + self._value[_DISTANCE] * distance + OFFSET
        return total

    def with_slopes(self, a: Points, count: Array, scales: Array) -> tuple[Array, Slopes]:
        """Return the covariance C (n, n) of the average rewards of n reaches, with their noise, and a function for its derivatives.

        `a`: the reaches. `count`: (n,) number of tries over which the reward of each reach is averaged. `scales`: (n, n) factors by which
        the covariances of the mean rewards are multiplied: 1 or more for two reaches in the same earlier world, else 1 (`scales_of`). The
        function gets weights W (n, n). It returns the derivatives (8 + d,) of the scalar sum(W * C), over all elements, with respect to the
        logarithms of the parameters.
        """
        value, pair = self._value, np.ix_(a.state, a.state)
        place_far = _squared(a.target, a.target) / value[_PLACE_L] ** 2
        approach_far = _squared(a.vector, a.vector) / value[_APPROACH_L] ** 2
        distance_far = (a.remaining[:, None] - a.remaining) ** 2 / value[_DISTANCE_L] ** 2
        place, approach = self._by_place[pair] * np.exp(-0.5 * place_far), self._by_approach[pair] * np.exp(-0.5 * approach_far)
        distance = value[_DISTANCE] * np.exp(-0.5 * distance_far)
        joints = [squares[pair] / length**2 for squares, length in zip(self._squares, value[_JOINTS:], strict=True)]

        def slopes(weights: Array) -> Array:
            """Return the derivatives (8 + d,) of sum(weights * covariance) by the logarithms of the parameters; `weights`: (n, n)."""
            noise = (weights.diagonal() / count).sum() * value[_NOISE]
            weights = weights * scales
            by_place, by_approach, by_distance = weights * place, weights * approach, weights * distance
            narrower = by_approach / value[_APPROACH_J] ** 2
            by_joint = [float((by_place * far).sum()) for far in joints]
            by_joint_too = [float((narrower * far).sum()) for far in joints]
            return np.array(
                [
                    noise,
                    by_place.sum(),
                    (by_place * place_far).sum(),
                    by_approach.sum(),
                    (by_approach * approach_far).sum(),
                    sum(by_joint_too),
                    by_distance.sum(),
                    (by_distance * distance_far).sum(),
                    *np.add(by_joint, by_joint_too),
                ]
            )

        return (place + approach + distance + OFFSET) * scales + np.diag(value[_NOISE] / count), slopes


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """The features of n reaches that the covariance function needs.

    `state`: (n,) number of the state in which each reach starts. `target`: (n, 3) m, root frame. `vector`: (n, 3) m, from the hand to the
    target. `remaining`: (n,) m, the distance that remains after the reach, as `LinearArm` (a linear arm with springs) predicts it.
    """

    state: Ints
    target: Array
    vector: Array
    remaining: Array


def points(arm: LinearArm, state: Ints, target: Array) -> Points:
    """Return the features of reaches from states (n,) for targets (n, 3) [m], or for one target (3,) [m], root frame.

    `arm`: predicts the distances that remain after the reaches, and has the positions of the hand in the states.
    """
    targets = np.broadcast_to(target, (len(state), 3))
    vector = targets - arm.reaches.hands[state]
    return Points(state, targets, vector, arm.remaining(state, vector))


class LinearArm:
    """Predicts the reward of a reach from the distance that remains with a linear arm with springs.

    The expected reward is offset + slope / (1 + distance / scale), where `scale` is that of the reaches (thesis eq. 8.4).

    Args:
        reaches: the reach actions: the marker's position and Jacobian in each state. Without Jacobians the arm does not move, and the whole
            distance remains.
        compliance: g of the springs, in rad/m^2: in a state with the Jacobian J, a remaining error e [m] turns the joints by g J^T e.
        offset, slope: of the expected reward, see above.
    """

    def __init__(self, reaches: Reaches, compliance: float = DEFAULT_COMPLIANCE, offset: float = 0.0, slope: float = 1.0) -> None:
        self.reaches, self.compliance, self.offset, self.slope = reaches, compliance, offset, slope
        joints = np.zeros((len(reaches), 3, 1)) if reaches.jacobians is None else reaches.jacobians
        squares: Array = joints @ np.swapaxes(joints, 1, 2)
        self._shares: Array = np.asarray(np.linalg.inv(np.eye(3) + compliance * squares), dtype=np.float64)

    def remaining(self, state: Ints, vector: Array) -> Array:
        """Return the distances [m] that remain after reaches from states (n,), shape (n,). `vector`: (n, 3) m, from hand to target."""
        remaining = np.einsum("nij,nj->ni", self._shares[state], vector)
        length: Array = np.sqrt((remaining**2).sum(axis=1))
        return length

    def rewards(self, state: Ints, target: Array) -> Array:
        """Return the expected rewards of reaches from states (n,) for targets (n, 3) m, or for one target (3,) m, shape (n,)."""
        expected: Array = self.offset + self.slope * self._own(state, target)
        return expected

    def fitted(self, known: Reached) -> LinearArm:
        """Return a new arm with the compliance, offset and slope that fit the observed rewards best (least squares).

        `known`: the reaches observed so far; the arm is fitted to the average reward of each pair of state and target. The compliance is
        one of COMPLIANCES; the slope has a weak prior of 1, and is at least 0.
        """
        target = known.places[known.target]
        return min((self._with(compliance, known, target) for compliance in COMPLIANCES), key=lambda found: found[0])[1]

    def _with(self, compliance: float, known: Reached, target: Array) -> tuple[float, LinearArm]:
        arm = LinearArm(self.reaches, compliance)
        own = arm._own(known.state, target)
        middle, mean = float(own.mean()), float(known.mean.mean())
        gap, error = own - middle, known.mean - mean
        arm.slope = max(
            float(gap @ error + SLOPE_WEIGHT * own @ own / len(own)) / float(gap @ gap + SLOPE_WEIGHT * own @ own / len(own)), 0.0
        )
        arm.offset = mean - arm.slope * middle
        return float(((known.mean - arm.offset - arm.slope * own) ** 2).sum()), arm

    def _own(self, state: Ints, target: Array) -> Array:
        """Return the rewards of the arm, before the linear function (thesis eq. 8.4)."""
        rewards: Array = 1.0 / (1.0 + self.remaining(state, target - self.reaches.hands[state]) / self.reaches.scale)
        return rewards


def default_parameters(reaches: Reaches) -> Array:
    """Return the logarithms of the covariance parameters before the first fit, shape (8 + d,).

    First come the parameters in `DEFAULTS` (variances of rewards, and lengths in m), then one length for each joint, in units of the spread
    of its samples (largest minus smallest).
    """
    return np.log([*DEFAULTS.values(), *[DEFAULT_JOINT] * reaches.samples.shape[1]])


def joint_squares(reaches: Reaches) -> Array:
    """Return for each joint the squared differences between the samples of all pairs of states, shape (d, S, S).

    The sample of a state is the pose of the d joints at which its reaches begin. The positions of each joint are first divided by their
    spread (largest minus smallest).
    """
    scaled = (reaches.samples / np.maximum(np.ptp(reaches.samples, axis=0), 1e-9)).T
    squares: Array = (scaled[:, :, None] - scaled[:, None, :]) ** 2
    return squares


def scales_of(world: Ints, factors: Array) -> Array:
    """Return the numbers (n, n) by which the covariances K of the mean rewards of n reaches are multiplied.

    `world`: (n,) the index of the world of each reach. `factors`: (W,) for each world the factor d of its differences from the present
    world, see the module; 0 for the present one.
    """
    scales: Array = 1.0 + factors[world] * (world[:, None] == world)
    return scales


def fitted_parameters(logs: Array, arm: LinearArm, squares: Array, reached: Reached, expected: Array, factors: Array = ONE_WORLD) -> Array:
    """Return the logarithms of the covariance parameters with the highest posterior, (8 + d,), by a local search.

    `logs`: (8 + d,), where the search begins, for d joints. `arm`: gives the features of the reaches (`points`). `squares`: (d, S, S) for S
    states, from `joint_squares`. `reached`: the n pairs of state and target that were tried, with their rewards. `expected`: (n,) prior
    mean reward of each pair. `factors`: (W,) for each of W worlds (in which reaches were made) how much its rewards differ from those of
    the present one, 0: not at all; see `scales_of`.
    """
    from scipy.optimize import minimize

    bounds = [(middle - 4.0 * PRIOR_DEVIATION, middle + 4.0 * PRIOR_DEVIATION) for middle in default_parameters(arm.reaches)]
    found = minimize(
        negative_log_posterior,
        logs,
        (arm, squares, reached, expected, factors),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": MAX_STEPS},
    )
    best: Array = found.x
    return best


def negative_log_posterior(
    logs: Array, arm: LinearArm, squares: Array, reached: Reached, expected: Array, factors: Array = ONE_WORLD
) -> tuple[float, Array]:
    """Return the negative log posterior of the covariance parameters, up to a constant, and its derivatives (8 + d,).

    It is the negative logarithm of the evidence (marginal likelihood) of the rewards times the prior of the parameters. The average reward
    of each pair of state and target and the scatter around it are used, which is equivalent to using every reward. If there are more than
    500 pairs, the averages of only 500 are used.

    Args:
        logs: (8 + d,) logarithms of the parameters.
        arm: gives the features of the reaches (`points`).
        squares: (d, S, S) scaled squared differences of d joints between S states, from `joint_squares`.
        reached: the n pairs of state and target that were tried, with their rewards.
        expected: (n,) prior mean reward of each pair.
        factors: (W,) for each of W worlds (in which reaches were made) how much its rewards differ from those of the present one, 0: not at
            all; see `scales_of`.
    """
    from scipy.linalg import cho_factor, cho_solve

    chosen = fitted_pairs(reached)
    seen = points(arm, reached.state[chosen], reached.places[reached.target[chosen]])
    covariance = Covariance(squares, logs)
    matrix, slopes = covariance.with_slopes(seen, reached.count[chosen], scales_of(reached.world[chosen], factors))
    factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
    residual = (reached.mean - expected)[chosen]
    weight = cho_solve(factor, residual, check_finite=False)
    inverse = cho_solve(factor, np.eye(len(chosen)), check_finite=False)
    repeats, scatter, noise = reached.tries - len(reached), reached.scatter, covariance.noise
    deviation = (logs - default_parameters(arm.reaches)) / PRIOR_DEVIATION
    value = 0.5 * residual @ weight + np.log(factor[0].diagonal()).sum()
    value += 0.5 * (repeats * np.log(noise) + scatter / noise) + 0.5 * deviation @ deviation
    slope = 0.5 * slopes(inverse - weight[:, None] * weight) + deviation / PRIOR_DEVIATION
    slope[0] += 0.5 * (repeats - scatter / noise)
    return float(value), slope


def fitted_pairs(reached: Reached) -> Ints:
    """Return the indices, ascending, of the pairs of state and target that a fit uses: at most MAX_FITTED (500).

    Pairs of the newest world (the surroundings and the robot of the newest reaches) are chosen first; pairs of all other worlds fill the
    remaining number. If one of these two groups has too many pairs, evenly spaced ones are chosen from it, in the order of their first
    reaches.
    """
    newest = reached.world == reached.world.max(initial=0)
    chosen: list[Ints] = []
    for group in (np.flatnonzero(newest), np.flatnonzero(~newest)):
        number = min(len(group), MAX_FITTED - sum(map(len, chosen)))
        chosen.append(group[np.unique(np.linspace(0, len(group) - 1, number).round().astype(np.intp))])
    return np.sort(np.concatenate(chosen))


def fitted_factors(between: Array, noise: Array, residual: Array, world: Ints, factors: Array) -> Array:
    """Return the factors (W,) with the largest evidence (marginal likelihood) of the rewards, by a local search over FACTORS.

    A factor d describes how much a world differs from the present one, see the module.

    Args:
        between: (n, n) covariances K of the mean rewards of n pairs of state and target.
        noise: (n,) variance of the average reward of each pair around its mean.
        residual: (n,) average reward of each pair, minus its prior mean.
        world: (n,) index of the world of each pair, 0 to W - 1.
        factors: (W,) where the search begins, values in FACTORS. The last world is the present one: its factor stays 0.
    """
    from scipy.linalg import cho_factor, cho_solve

    known: dict[tuple[float, ...], float] = {}

    def evidence(trial: tuple[float, ...]) -> float:
        if trial not in known:
            matrix = between * scales_of(world, np.array(trial)) + np.diag(noise)
            factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
            known[trial] = -0.5 * residual @ cho_solve(factor, residual, check_finite=False) - np.log(factor[0].diagonal()).sum()
        return known[trial]

    best: tuple[float, ...] = tuple(factors.tolist())
    before: tuple[float, ...] = ()
    while best != before:
        before = best
        for number in np.unique(world[world < len(factors) - 1]).tolist():
            at = FACTORS.index(best[number])
            near = [(*best[:number], factor, *best[number + 1 :]) for factor in FACTORS[max(at - 1, 0) : at + 2]]
            best = max(near, key=evidence)
    return np.array(best)


def _squared(a: Array, b: Array) -> Array:
    """Return squared distances between rows, shape (a, b); exactly 0 for the same row."""
    gap: Array = a[:, 0, None] - b[:, 0]
    total = gap * gap
    for axis in range(1, a.shape[1]):
        gap = a[:, axis, None] - b[:, axis]
        total += gap * gap
    return total
