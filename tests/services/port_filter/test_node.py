# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.control.reflex import Violation
from services.port_filter.node import described
from tests.mobee.planar import tree

ROBOT = tree(0)


@pytest.mark.parametrize(
    ("kind", "what", "depth", "text"),
    [
        ("contact", "hand - table", 0.012, "contact hand - table 12 mm deep"),
        ("limit", "m3", np.deg2rad(3.0), "limit m3 by 3.0 degrees"),
        ("limit", "m4", 0.0125, "limit m4 by 12.5 mm"),  # drives a prismatic joint
        ("clause", "arm clause 0", np.deg2rad(2.0), "clause arm clause 0 by 2.0 degrees"),
    ],
)
def test_a_violation_is_described_in_its_unit(kind: str, what: str, depth: float, text: str) -> None:
    assert described(ROBOT, Violation(kind, what, depth)) == text  # type: ignore[arg-type]  # a str
