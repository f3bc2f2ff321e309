from __future__ import annotations

import numpy as np

from mobee import NES
from mobee.roadmap.evolution.search import Searches


def test_each_of_several_searches_does_what_one_alone_does() -> None:
    d, count, std = 7, 3, 0.3
    rng = np.random.default_rng(2)
    means = rng.uniform(-1.0, 1.0, (count, d))
    alone = [NES(mean, std, seed=k) for k, mean in enumerate(means)]
    searches = Searches(count + 1, d, alone[0].population)
    which = np.array([0, 2, 3])
    for number, mean in zip(which, means, strict=True):
        searches.begin(number, mean, std)
    scale = 10.0 ** np.linspace(0.0, 2.0, d)
    for _ in range(15):
        samples = np.stack([one.ask() for one in alone])
        z = np.stack([one._z for one in alone])
        assert np.allclose(searches.ask(which, z), samples, rtol=1e-9, atol=1e-12)
        costs = ((samples * scale) ** 2).sum(axis=2)
        for one, cost in zip(alone, costs, strict=True):
            one.tell(cost)
        searches.tell(which, z, costs)
    assert np.allclose(searches.mean[which], [one.mean for one in alone], rtol=1e-8, atol=1e-12)
    assert np.allclose(searches.sigma[which], [std * one.sigma for one in alone], rtol=1e-8)
    assert (searches.age == [15, 0, 15, 15]).all()


def test_a_search_that_begins_anew_forgets_the_one_before() -> None:
    searches = Searches(1, 4, 8)
    which = np.array([0])
    rng = np.random.default_rng(0)
    searches.begin(0, np.zeros(4), 1.0)
    for _ in range(3):
        z = rng.standard_normal((1, 8, 4))
        searches.tell(which, z, (searches.ask(which, z) ** 2).sum(axis=2))
    searches.begin(0, np.full(4, 0.5), 0.1)
    z = rng.standard_normal((1, 8, 4))
    assert np.allclose(searches.ask(which, z), 0.5 + 0.1 * z)
    assert searches.age[0] == 0
