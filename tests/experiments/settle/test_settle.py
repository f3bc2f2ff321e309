from __future__ import annotations

import argparse

import pytest

from experiments import settle
from mobee import UnknownName


def test_a_small_run_is_told_and_drawn_and_not_done_twice(tmp_path) -> None:
    pytest.importorskip("matplotlib")
    arguments = argparse.Namespace(gains=["default"], periods=[20.0], postures=1, motors=["l_elbow"], seed=0)
    found = settle.run(arguments, tmp_path)
    assert found["passed"] and {kind: part["steps"] for kind, part in found["default"].items()} == {
        "20 ms, motors": 1,
        "20 ms, postures": 1,
    }
    written = (tmp_path / settle.RECORDS).read_bytes()
    assert settle.run(arguments, tmp_path) == found
    assert (tmp_path / settle.RECORDS).read_bytes() == written
    assert settle.figure(tmp_path).read_bytes().startswith(b"\x89PNG")


def test_an_unknown_motor_is_refused_before_anything_is_run(tmp_path) -> None:
    arguments = argparse.Namespace(gains=["default"], periods=[20.0], postures=1, motors=["l_elbw"], seed=0)
    with pytest.raises(UnknownName, match="Did you mean 'l_elbow'"):
        settle.run(arguments, tmp_path)
    assert not list(tmp_path.iterdir())
