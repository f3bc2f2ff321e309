# SPDX-License-Identifier: Apache-2.0
"""Cartesian genetic programming: formulas as a graph of functions, which an evolution strategy optimises (Miller and Thomson 2000)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mobee.arrays import Array, Ints

Function = Callable[[Array, Array], Array]
FUNCTIONS: Mapping[str, tuple[int, Function, str]] = {  # number of arguments, function, text
    "add": (2, lambda a, b: a + b, "({} + {})"),
    "subtract": (2, lambda a, b: a - b, "({} - {})"),
    "multiply": (2, lambda a, b: a * b, "{} * {}"),
    "divide": (2, lambda a, b: a / np.sqrt(1.0 + b * b), "({} / hypot(1, {}))"),  # without a pole
    "sine": (1, lambda a, b: np.sin(a), "sin({})"),
    "cosine": (1, lambda a, b: np.cos(a), "cos({})"),
    "square": (1, lambda a, b: a * a, "{}^2"),
}
NODES, TERMS = 120, 60  # of a graph
CHILDREN, GENERATIONS, RATE = 4, 2500, 0.005  # of the evolution strategy; share of the genes that change
PENALTY = 3e-3  # of squared coefficients, per row


class CartesianPrograms:
    """Regression by a weighted sum of formulas (Cartesian genetic programming).

    The formulas are the 60 outputs of a graph of 120 nodes. Each node has a function and two arguments, which are inputs or earlier nodes.
    The graph is evolved: in each generation the parent has 4 mutated children, and the best child replaces the parent unless it is worse,
    so that neutral changes accumulate. The weights of the outputs are found by least squares.
    """

    def __init__(self, seed: int, generations: int = GENERATIONS) -> None:
        """Make a regression that is not fitted yet; `seed`: of the evolution, a whole number of at least 0.

        `generations`: number of generations of the evolution.
        """
        self._seed, self._generations = seed, generations
        self._genes: Ints = np.empty(0, dtype=np.intp)
        self._weights: Array = np.empty(0)
        self._inputs = 0

    def fit(self, x: Array, y: Array) -> CartesianPrograms:
        """Learn targets y (N, t) from inputs x (N, d), both standardised; return this object."""
        rng, self._inputs = np.random.default_rng([self._seed, 0x636770]), x.shape[1]
        ranges = self._ranges()
        best = rng.integers(ranges)
        error, weights = self._solved(best, x, y)
        for _ in range(self._generations):
            children = [np.where(rng.uniform(size=len(best)) < RATE, rng.integers(ranges), best) for _ in range(CHILDREN)]
            found = [self._solved(child, x, y) for child in children]
            first = min(range(CHILDREN), key=lambda number: found[number][0])
            if found[first][0] <= error:
                best, (error, weights) = children[first], found[first]
        self._genes, self._weights = best, weights
        return self

    def predict(self, x: Array) -> Array:
        """Return the predicted targets (M, t) for standardised inputs x (M, d)."""
        found: Array = self._terms(self._genes, x) @ self._weights
        return found

    def formulas(self, names: Sequence[str]) -> list[str]:
        """Return the formulas of all outputs as text, those with the largest weights first; `names`: names of the inputs."""
        nodes, outputs = self._parts(self._genes)
        texts = list(names)
        for name, first, second in self._steps(nodes):
            count, _, text = FUNCTIONS[name]
            texts.append(text.format(*(texts[first], texts[second])[:count]))
        order = np.argsort(-np.abs(self._weights[1:]).max(axis=1))
        return [texts[outputs[number]] for number in order]

    def _ranges(self) -> Ints:
        """Return the number of values of each gene: function and two arguments of each node, then the outputs."""
        nodes = [[len(FUNCTIONS), self._inputs + number, self._inputs + number] for number in range(NODES)]
        return np.array([*np.ravel(nodes), *[self._inputs + NODES] * TERMS], dtype=np.intp)

    def _parts(self, genes: Ints) -> tuple[Ints, Ints]:
        return genes[: 3 * NODES].reshape(NODES, 3), genes[3 * NODES :]

    def _steps(self, nodes: Ints) -> list[tuple[str, int, int]]:
        names = list(FUNCTIONS)
        return [(names[function], first, second) for function, first, second in nodes.tolist()]

    def _terms(self, genes: Ints, x: Array) -> Array:
        """Return the values (N, 1 + TERMS) of the graph's outputs for N inputs x (N, d), after a first column of ones.

        `genes`: the graph, that is, function and arguments of each node, then the node of each output. Only nodes on which an output
        depends are computed.
        """
        nodes, outputs = self._parts(genes)
        steps = self._steps(nodes)
        needed, open_ = set[int](), [int(one) for one in outputs if one >= self._inputs]
        while open_:
            number = open_.pop()
            if number not in needed:
                needed.add(number)
                name, *arguments = steps[number - self._inputs]
                open_ += [one for one in arguments[: FUNCTIONS[name][0]] if one >= self._inputs]
        values: dict[int, Array] = dict(enumerate(x.T))
        for number in sorted(needed):
            name, first, second = steps[number - self._inputs]
            count, function, _ = FUNCTIONS[name]
            values[number] = np.clip(function(values[first], values[second if count == 2 else first]), -1e6, 1e6)
        return np.stack([np.ones(len(x)), *(values[int(one)] for one in outputs)], axis=1)

    def _solved(self, genes: Ints, x: Array, y: Array) -> tuple[float, Array]:
        """Return the mean squared error with the penalty, and the weights (1 + TERMS, t)."""
        terms = self._terms(genes, x)
        normal = terms.T @ terms / len(x) + PENALTY * np.eye(terms.shape[1])
        right = terms.T @ y / len(x)
        weights = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
        return float((y * y).mean(axis=0).sum() - (right * weights).sum()), weights
