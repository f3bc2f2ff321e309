# SPDX-License-Identifier: Apache-2.0
"""A small ensemble of neural networks that predict rewards; their disagreement is the uncertainty."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.reaches import Reaches

NETWORKS, HIDDEN = 5, 32
STEPS, BATCH = 4, 64  # of gradient descent after each reach
RATE, DECAY = 5e-3, 1e-4  # learning rate of Adam, and decay of the weights
MOMENTUM = 0.9, 0.99  # of the averages of slopes and of squared slopes
LENGTH_SCALE = 0.1  # m, unit of vectors and positions in the inputs


class Networks:
    """Predicts rewards by five neural networks with two hidden layers of 32 units; their disagreement is the uncertainty.

    The inputs are the joint positions, the target, and the vector from hand to target with its length. Each network counts each reach a
    random number of times, drawn from a Poisson distribution (online bootstrap). Unlike with the other predictors, the order of the reaches
    matters.

    Args:
        reaches: the reach actions, one for each state: joint positions and position of the hand's marker at which it begins.
        seed: seed of the first weights and of all random choices during learning.
    """

    def __init__(self, reaches: Reaches, seed: int = 0) -> None:
        self._reaches, self._seed = reaches, seed
        self._rng = np.random.default_rng(seed)
        spread = np.maximum(np.ptp(reaches.samples, axis=0), 1e-9)
        self._joints = 2.0 * (reaches.samples - reaches.samples.mean(axis=0)) / spread
        self._middle = reaches.hands.mean(axis=0)
        inputs = self._joints.shape[1] + 7
        sizes = [(inputs, HIDDEN), (HIDDEN, HIDDEN), (HIDDEN, 1)]
        self._weights = [self._rng.normal(0.0, 1.0 / np.sqrt(a), (NETWORKS, a, b)) for a, b in sizes]
        self._biases = [np.zeros((NETWORKS, 1, b)) for _, b in sizes]
        self._biases[-1] += self._rng.normal(-1.0, 1.0, self._biases[-1].shape)
        self._slow = [(np.zeros_like(one), np.zeros_like(one)) for one in (*self._weights, *self._biases)]
        self._inputs, self._rewards = np.empty((64, inputs)), np.empty(64)
        self._copies = np.empty((NETWORKS, 64))
        self._tries = self._step = 0
        self._last: tuple[bytes, int, Array] = (b"", -1, np.empty(0))

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor and its seed, as JSON values."""
        return {"name": "networks", "seed": self._seed}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from the reward of a reach that began in `state`, and again from some earlier reaches.

        `target`: (3,) m, root frame. `expected` is not used.
        """
        if self._tries == len(self._rewards):
            self._inputs, self._rewards = (np.concatenate([one, one]) for one in (self._inputs, self._rewards))
            self._copies = np.concatenate([self._copies, self._copies], axis=1)
        self._inputs[self._tries] = self._features(target)[state]
        self._rewards[self._tries] = reward
        self._copies[:, self._tries] = self._rng.poisson(1.0, NETWORKS)
        self._tries += 1
        for _ in range(STEPS):
            self._descend()

    def mean(self, target: Array) -> Array:
        """Return the expected reward of a reach from each state for a target (3,) m, root frame; (S,), the average of the networks."""
        mean: Array = self._each(target).mean(axis=0)
        return mean

    def deviation(self, target: Array) -> Array:
        """Return the standard deviation between the networks' predicted rewards of a reach from each state, shape (S,).

        `target`: (3,) m, root frame.
        """
        deviation: Array = self._each(target).std(axis=0, ddof=1)
        return deviation

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the rewards that one network, drawn at random, predicts for a reach from each state, shape (S,).

        `target`: (3,) m, root frame.
        """
        drawn: Array = self._each(target)[rng.integers(NETWORKS)]
        return drawn

    def _features(self, target: Array) -> Array:
        vector = (target - self._reaches.hands) / LENGTH_SCALE
        length = np.sqrt((vector**2).sum(axis=1, keepdims=True))
        place = np.broadcast_to((target - self._middle) / LENGTH_SCALE, vector.shape)
        return np.concatenate([self._joints, place, vector, length], axis=1)

    def _each(self, target: Array) -> Array:
        """Return the reward of a reach from each state for a target (3,) m, root frame, as each network predicts it: (networks, S)."""
        key = target.tobytes()
        if self._last[:2] != (key, self._tries):
            self._last = key, self._tries, layers(self._weights, self._biases, self._features(target))[-1][..., 0]
        return self._last[2]

    def _descend(self) -> None:
        """Make one step of Adam on the squared errors of some reaches, including the newest."""
        chosen = self._rng.integers(self._tries, size=(NETWORKS, BATCH))
        chosen[:, 0] = self._tries - 1
        copies = np.take_along_axis(self._copies, chosen, axis=1)
        errors = slopes(self._weights, self._biases, self._inputs[chosen], self._rewards[chosen], copies)
        self._step += 1
        kept, squares = MOMENTUM
        rate = RATE * np.sqrt(1.0 - squares**self._step) / (1.0 - kept**self._step)
        for value, slope, (average, square) in zip((*self._weights, *self._biases), errors, self._slow, strict=True):
            average += (1.0 - kept) * (slope - average)
            square += (1.0 - squares) * (slope**2 - square)
            value -= rate * average / (np.sqrt(square) + 1e-8) + RATE * DECAY * value


def layers(weights: list[Array], biases: list[Array], inputs: Array) -> list[Array]:
    """Return the activations of the two hidden layers and of the output layer, each (networks, n, size of the layer).

    `weights`: of the three layers, each (networks, inputs, outputs); `biases`: each (networks, 1, outputs). `inputs`: (n, features), or
    (networks, n, features) with own inputs for each network.
    """
    first = np.tanh(inputs @ weights[0] + biases[0])
    second = np.tanh(first @ weights[1] + biases[1])
    return [first, second, 1.0 / (1.0 + np.exp(-(second @ weights[2] + biases[2])))]


def slopes(weights: list[Array], biases: list[Array], inputs: Array, rewards: Array, copies: Array) -> list[Array]:
    """Return the derivatives of the error of each network: with respect to the weights of the three layers, then to their three biases.

    The error of a network is half the mean over n reaches of the squared error of its predicted reward, times `copies`. The derivatives
    have the shapes of `weights`, each (networks, inputs, outputs), and `biases`, each (networks, 1, outputs). `inputs`: (networks, n,
    features). `rewards`: (networks, n), observed. `copies`: (networks, n), how many times each network counts each reach.
    """
    first, second, predicted = layers(weights, biases, inputs)
    out = ((predicted[..., 0] - rewards) * copies)[..., None] * predicted * (1.0 - predicted) / inputs.shape[1]
    back = (out @ weights[2].swapaxes(1, 2)) * (1.0 - second**2)
    further = (back @ weights[1].swapaxes(1, 2)) * (1.0 - first**2)
    by_weights = [one.swapaxes(1, 2) @ error for one, error in ((inputs, further), (first, back), (second, out))]
    return by_weights + [error.sum(axis=1, keepdims=True) for error in (further, back, out)]
