from __future__ import annotations

import numpy as np

from experiments.reach.telling import selected

STRAIGHT = np.linspace([-0.3, 0.0, 0.0], [-0.3, 0.3, 0.0], 20)
FAR = np.linspace([-0.3, 0.0, 0.0], [-0.3, 0.5, 0.0], 20)
ABOVE = np.linspace([-0.2, 0.3, 0.3], [-0.2, 0.3, 0.1], 20)
TURNING = np.concatenate([STRAIGHT, STRAIGHT[::-1] + [0.0, 0.0, 0.05]])
SHORT = np.linspace([-0.3, 0.0, 0.0], [-0.3, 0.05, 0.0], 20)


def test_each_kind_of_way_is_selected_once() -> None:
    found = selected([STRAIGHT, SHORT, ABOVE, TURNING, FAR])
    assert found == {"From above": 2, "Far": 4, "Around the target": 3}


def test_of_fewer_ways_than_kinds_each_is_selected_once_and_short_ones_never() -> None:
    assert selected([SHORT]) == {}
    assert selected([SHORT, FAR]) == {"From above": 1}
