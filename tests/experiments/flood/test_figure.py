from __future__ import annotations

import builtins

import pytest

import mobee
from experiments import flood
from experiments.flood.endurance import endure
from experiments.matplotlib_figure import MatplotlibMissing

HEAD = "robot,objects,edits,seconds,evaluations\n"


def test_the_figure_is_drawn_from_the_records(tmp_path):
    pytest.importorskip("matplotlib")
    (tmp_path / "flood.csv").write_text(HEAD + "icub,0,0,0.5,500\nicub,1,2000,0.3,200\nkatana,1,2000,0.3,900\n")
    picture = flood.figure(tmp_path)
    assert picture.parent == tmp_path
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_of_an_endurance_run_its_course_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    endure(tmp_path, threads=1, duration=0.2, seed=0)
    assert flood.figure(tmp_path).read_bytes().startswith(b"\x89PNG")


def test_without_records_there_is_nothing_to_draw(tmp_path):
    (tmp_path / "flood.csv").write_text(HEAD)
    with pytest.raises(mobee.InvalidValue, match="no records"):
        flood.figure(tmp_path)


def test_without_matplotlib_it_is_said_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "flood.csv").write_text(HEAD + "icub,0,0,0.5,500\n")
    real = builtins.__import__

    def missing(name, *rest, **more):
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(MatplotlibMissing, match=r"pip install '\.\[figures\]'"):
        flood.figure(tmp_path)
