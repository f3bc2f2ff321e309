# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee_cli.reach_live import MOVES, first_moving_command


@pytest.mark.parametrize("modality", ["position", "velocity", "torque"])
def test_the_first_command_that_moves_differs_from_those_at_rest(modality: str) -> None:
    rest, moves = np.array([0.3, -0.2]), MOVES[modality]
    commands = [(1.0, rest + 5 * moves), (2.0, rest), (3.0, rest - 0.5 * moves), (4.0, rest + [0.0, 2 * moves]), (5.0, rest)]
    assert first_moving_command(commands, begun=2.5, moves=moves) == 4.0
    assert first_moving_command(commands, begun=4.5, moves=moves) == 5.0
    assert first_moving_command(commands, begun=0.5, moves=moves) is None  # its position at rest is not known
