# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from experiments.kit.reaching.arm import reach_plant


def test_the_law_of_a_plant_is_the_one_asked_for():
    assert reach_plant(0).settings["gains"] != reach_plant(0, "default").settings["gains"]
