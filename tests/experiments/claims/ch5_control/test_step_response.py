# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from experiments.claims.ch5_control.step_response import EXPERIMENT
from mobee import UnknownName
from tests.experiments.options import options_of

OPTIONS = ("--gains", "default", "--periods", "20", "--postures", "1", "--motors")


def test_an_unknown_motor_is_refused_before_anything_is_run(tmp_path) -> None:
    with pytest.raises(UnknownName, match="Did you mean 'l_elbow'"):
        EXPERIMENT.method.run(options_of(EXPERIMENT, *OPTIONS, "l_elbw"), tmp_path)
    assert not list(tmp_path.iterdir())
