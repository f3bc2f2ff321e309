# SPDX-License-Identifier: Apache-2.0
"""A cut of the network that nothing reports, between robot_sim and its controller; `mobee bench network` does more to it."""

from __future__ import annotations

import pytest

from experiments.bench.network import Settings, measure, report
from experiments.kit.live.network import refused

pytestmark = pytest.mark.system


def test_the_robot_holds_beyond_a_silent_cut_and_is_back_after_it() -> None:
    """Controller, model and an agent are on a host whose monotonic clock is an hour ahead, with keys."""
    if reason := refused():
        pytest.skip(reason)
    result = measure(Settings(layouts=("control",), faults=("silent cut",), seconds=3.0))
    print(report(result))
    assert result["broken"] == []
    assert result["rows"][0]["held"] == ["head", "left_arm", "right_arm", "torso"]
    kept = result["transitions"]
    assert (kept["lost"], kept["differing"], kept["repeated"]) == (0, 0, 0)
