# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.control.arm_commands import FARTHEST, LONG, SHORT, as_numbers, from_numbers, random_command, vary


def test_random_commands_leave_the_joint_box_and_stay_in_it() -> None:
    commands = [random_command(np.random.default_rng(seed), forced=False) for seed in range(40)]
    inside = [command for command in commands if command.is_inside]
    assert 10 <= len(inside) <= 30
    assert max(np.abs(command.attractors).max() for command in commands) > 0.8 * FARTHEST
    assert not any(command.is_forced for command in commands)
    assert all((command.seconds >= SHORT).all() and (command.seconds <= LONG).all() for command in commands)


@pytest.mark.parametrize("seed", range(20))
def test_a_variation_keeps_a_command_in_its_box(seed) -> None:
    rng = np.random.default_rng(seed)
    one, other = random_command(rng, forced=True), random_command(rng, forced=True)
    new = vary(rng, one, other)
    assert np.abs(new.start).max() <= 1.0 and np.abs(new.attractors).max() <= FARTHEST and np.abs(new.forces).max() <= 1.0
    assert np.abs(new.pushes).max() <= 1.0
    assert not np.array_equal(new.seconds, one.seconds)


def test_a_command_comes_back_from_its_numbers() -> None:
    command = random_command(np.random.default_rng(3), forced=True)
    again = from_numbers(as_numbers(command))
    assert again.attractors == pytest.approx(command.attractors, abs=1e-6)
    assert np.array_equal(again.forces, command.forces) and np.array_equal(again.pushes, command.pushes)
    assert again.start == pytest.approx(command.start, abs=1e-6)
