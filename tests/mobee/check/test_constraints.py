# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.control.gains import Gains
from mobee.control.law import Law
from tests.mobee.check.arm import SLIDE, arm, named


def clauses(folder: Path, *lists: str) -> list[str]:
    """The findings about constraint lists; pan is 0 within -90..90 at home, bend 30 within 10..100."""
    text = "".join(f"<constraintList>{rows}</constraintList>" for rows in lists)
    findings = named(arm(folder, ("</bodypart>", f"{text}</bodypart>")), "constraint")
    return [f"{finding.severity}: {finding.what}" for finding in findings]


def row(a: str, b: float, q: str = "pan") -> str:
    return f'<constraint a="{a}" q="{q}" b="{b}"/>'


def test_constraints_that_can_be_satisfied_and_can_be_violated_are_none(tmp_path: Path) -> None:
    assert clauses(tmp_path, row("1", 45), row("-1 1", 20, "pan bend"), row("1", -50) + row("-1", 50)) == []


def test_a_constraint_beyond_the_limits_is_an_error(tmp_path: Path) -> None:
    (said,) = clauses(tmp_path, row("1", -100))
    assert said == "error: the constraint on pan cannot be satisfied within the limits: a.q + b reaches -10 deg at most"


def test_a_constraint_on_a_slide_is_judged_and_written_in_metres(tmp_path: Path) -> None:
    text = '<constraintList><constraint a="{}" q="bend" b="{}"/></constraintList></bodypart>'
    for factor, offset, said in ((-1, 0.11, "home lies near"), (1, -0.15, "home violates"), (1, -0.3, "cannot be satisfied")):
        robot = arm(tmp_path, *SLIDE, ("</bodypart>", text.format(factor, offset)))
        (finding,) = named(robot, "constraint")
        assert said in finding.what
        assert "below 0.012 m:" in finding.why or not said.startswith("home lies")
        assert f" {(0.2 if said.startswith('cannot') else factor * 0.1) + offset:.4g} m " in finding.what


def test_home_in_violation_is_found(tmp_path: Path) -> None:
    (said,) = clauses(tmp_path, row("1", -45))
    assert said == "warning: home violates the constraint on pan: a.q + b is -45 deg there"


def test_a_constraint_on_a_slide_pushes_in_the_zone_of_the_law_only(tmp_path: Path) -> None:
    row = '<constraintList><constraint a="-1" q="bend" b="{}"/></constraintList></bodypart>'
    for boundary, pushes in ((0.111, True), (0.113, False)):
        robot = arm(tmp_path, *SLIDE, ("</bodypart>", row.format(boundary)))
        assert (len(named(robot, "constraint")) == 1) == pushes
        assert bool(np.any(Law(robot, Gains.default()).forces(robot.home, np.zeros(2))[1])) == pushes


@pytest.mark.parametrize(("b", "pushes"), [(10, True), (15, False)])
def test_a_home_so_near_to_a_boundary_that_it_pushes_is_noted(tmp_path: Path, b: float, pushes: bool) -> None:
    said = clauses(tmp_path, row("1", b))
    assert said == (["note: home lies near the boundary of the constraint on pan: a.q + b is 10 deg there"] if pushes else [])


def test_a_constraint_that_is_always_satisfied_is_noted(tmp_path: Path) -> None:
    (said,) = clauses(tmp_path, row("1 1", 85, "pan bend"))
    assert said == "note: the constraint on pan, bend is satisfied in every pose within the limits: a.q + b is never below 5 deg"


def test_a_row_that_never_is_satisfied_is_noted(tmp_path: Path) -> None:
    (said,) = clauses(tmp_path, row("1", 45) + row("1", -95))
    assert said == "note: row 2 of the constraint on pan is satisfied in no pose within the limits: a.q + b stays below -5 deg"


def test_constraints_that_contradict_each_other_are_named_alone(tmp_path: Path) -> None:
    said = clauses(tmp_path, row("1", 45), row("1 -1", -20, "pan bend"), row("-1 1", 10, "pan bend"))
    (error,) = [one for one in said if one.startswith("error")]
    assert error.startswith("error: the constraint on pan, bend contradicts ")
    assert error.endswith("toy.xml:18: no pose within the limits was found that satisfies them together")


@pytest.mark.parametrize("gap", [1e-3, 1.0])
def test_a_narrow_corner_that_no_sample_hits_is_found(tmp_path: Path, gap: float) -> None:
    """pan within `gap` of 80 and bend within `gap` of 90: thousandths of the range."""
    corner = (row("1", -80), row("-1", 80 + gap), row("1", -90, "bend"), row("-1", 90 + gap, "bend"))
    assert not any("contradicts" in said for said in clauses(tmp_path, *corner))
