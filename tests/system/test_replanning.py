# SPDX-License-Identifier: Apache-2.0
"""The real processes: a ball becomes solid in front of the hand, and the hand moves around it at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.claims.ch3_roadmaps.replanning import SOON, cross, measure
from experiments.claims.ch3_roadmaps.replanning_live import ABOVE, LEFT, Job

pytestmark = pytest.mark.system


@pytest.mark.untimed
def test_a_ball_that_turns_solid_is_gone_around_within_200_ms_of_the_bump_on_the_simulators_clock(tmp_path: Path) -> None:
    cross(tmp_path, Job([0.4]), seed=0, lockstep=True)
    (crossing,) = measure(tmp_path)
    assert crossing.bumped and crossing.on == [LEFT, ABOVE, LEFT] and crossing.arrived
    assert 0.0 < crossing.command <= SOON and crossing.turn <= SOON
    assert crossing.deepest == 0.0
