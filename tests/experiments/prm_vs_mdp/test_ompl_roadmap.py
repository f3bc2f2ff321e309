from __future__ import annotations

import argparse
import sys

import numpy as np
import pytest

from experiments.prm_vs_mdp import run
from experiments.prm_vs_mdp.belief import believed
from experiments.prm_vs_mdp.ompl_roadmap import OmplMissing, ompl_roadmap
from experiments.prm_vs_mdp.scene import BALLS, Scene

EMPTY = np.zeros((0, 4))
SCENE = Scene(np.full((BALLS, 3), 5.0), np.zeros((BALLS, 3)), np.zeros(4), EMPTY, np.zeros(0, dtype=int), np.zeros(0, dtype=bool))


def test_a_roadmap_follows_from_its_seed_and_holds_only_sound_poses_and_motions():
    pytest.importorskip("ompl")
    belief = believed(SCENE, "true")
    first, again, other = (ompl_roadmap(belief, 30, 5, seed) for seed in (3, 3, 4))
    assert len(first.vertices) >= 30 and first.edges > 30
    assert np.array_equal(first.vertices, again.vertices) and first.edges == again.edges
    assert not np.array_equal(first.vertices[:30], other.vertices[:30])
    assert belief.sound(first.vertices).all()
    for vertex in range(5):
        for other_vertex in first._costs[vertex]:
            assert belief.is_sound_motion(first.vertices[vertex], first.vertices[other_vertex])


def test_without_ompl_it_says_how_to_get_it_before_anything_is_begun(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ompl", None)
    with pytest.raises(OmplMissing, match=r"planning"):
        run(argparse.Namespace(), tmp_path)
    assert not list(tmp_path.iterdir())
