from __future__ import annotations

import builtins
import importlib

import pytest

import mobee
from experiments import flood
from experiments.flood.endurance import endure
from experiments.kit.plots import MatplotlibMissing, new_figure

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


def drawn(tmp_path, monkeypatch, rows):
    """The axes that were drawn of these rows."""
    pytest.importorskip("matplotlib")
    made = []
    module = importlib.import_module("experiments.flood.figure")  # the package has a function of that name
    monkeypatch.setattr(module, "new_figure", lambda *size: made.append(new_figure(*size)) or made[0])
    (tmp_path / "flood.csv").write_text(HEAD + rows)
    flood.figure(tmp_path)
    return made[0].axes[0]


def test_a_curve_of_one_point_has_a_marker_and_the_axis_ends_with_the_data(tmp_path, monkeypatch):
    axes = drawn(tmp_path, monkeypatch, "".join(f"icub,{n},200,0.01,10\n" for n in range(1, 61)))
    (line,) = (line for line in axes.lines if line.get_label() == "iCub, flooded")
    assert len(line.get_xdata()) == 1 and line.get_marker() == "s"
    assert 60.0 < axes.get_xlim()[1] < 70.0
    assert not axes.collections, "the thesis speaks of hundreds of objects"


def test_the_thesis_band_ends_with_the_data(tmp_path, monkeypatch):
    axes = drawn(tmp_path, monkeypatch, "icub,300,2000,0.5,500\n")
    (band,) = axes.collections
    assert band.get_paths()[0].get_extents().x1 == 300.0


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
