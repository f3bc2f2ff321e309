# SPDX-License-Identifier: Apache-2.0
"""Models with other settings."""

from __future__ import annotations

import time

import numpy as np
import pytest

from mobee import Gains, constraint_forces, load_robot
from tests.services.harness import rig
from tests.services.model.stage import Stage, library, on_the_table, staged


def test_without_contact_forces_contacts_are_published_but_cause_no_force(tmp_path_factory: pytest.TempPathFactory) -> None:
    with rig(tmp_path_factory.mktemp("numb"), load_robot("icub")) as made:
        numb = staged(made, "--no-contact-forces")
        answer = numb.at(on_the_table())
        assert np.abs(answer.terms["collision"]).max() == 0.0
        assert np.abs(answer.terms["limits"]).max() + np.abs(answer.terms["constraints"]).max() > 0.0
        assert answer.touched["left_arm"] == ["table"]
        assert numb.contacts[-1].contacts
        assert numb.numbers()["table_ticks"] == 1
        assert numb.model.stop() == 0


def test_the_published_propagation_spares_the_torso(tmp_path_factory: pytest.TempPathFactory) -> None:
    q, robot = on_the_table(), load_robot("icub")
    with rig(tmp_path_factory.mktemp("part"), robot) as made:
        answer = staged(made, "--propagate", "part", "--gains", "default").at(q)
        expected = constraint_forces(library().evaluate(q), Gains.default(), "part")
        np.testing.assert_allclose(answer.terms["collision"], expected.collision, atol=1e-12)


def test_contacts_are_published_with_the_forces_if_terms_need_them(tmp_path_factory: pytest.TempPathFactory) -> None:
    with rig(tmp_path_factory.mktemp("terms"), load_robot("icub")) as made:
        telling = staged(made, "--terms", "elsewhere:viscous")
        answer = telling.at(on_the_table())
        assert answer.contacts and answer.contacts == telling.contacts[-1].contacts


def test_a_missing_world_is_refused_in_one_line(stage: Stage) -> None:
    start = time.monotonic()
    program = stage.rig.spawn("-m", "services.model", "--endpoint", stage.rig.endpoint, "--world", "tabel")
    assert program.wait(20.0) == 2
    assert "Did you mean 'table'?" in program.says
    assert "Traceback" not in program.says
    print(f"refused after {time.monotonic() - start:.1f} s")


def test_a_second_model_that_is_started_by_hand_ends_and_the_first_continues(stage: Stage) -> None:
    second = stage.rig.spawn("-m", "services.model", "--endpoint", stage.rig.endpoint)
    assert second.wait(30.0) == 3
    first = stage.rig.stat("model")
    assert f"model runs already at {stage.rig.endpoint} (process {first.pid}), and two would both be obeyed" in second.says
    assert stage.rig.instances("model") == {first.instance}
