# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np
import pytest

from experiments.claims.robot_files import urdf_files
from experiments.claims.robot_files.urdf_comparison import PeerFailed, UrdfPeer, compare_file
from mobee.robot.load import load_robot
from tests.mobee.robot.urdf_files import ARM, arm_with, foreign, srdf_file, urdf_file

pytest.importorskip("pinocchio")


def given(*folders: str, only: str = "") -> argparse.Namespace:
    return argparse.Namespace(folders=list(folders), poses=5, only=only, seed=0)


def test_a_run_is_resumed_summarized_and_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    files = tmp_path / "files"
    (files / "sub").mkdir(parents=True)
    arm_with(files / "sub", '<sphere radius="0.1"/>')
    srdf_file(files / "sub", '<group_state name="up" group="all"><joint name="elbow" value="1"/></group_state>')
    (files / "broken.urdf").write_text("<robot>")
    shutil.copytree(foreign("kuka_iiwa"), files / "kuka", ignore=shutil.ignore_patterns("*.sdf", "model_*", "kuka_*"))
    found = urdf_files.run(given(f"own={files}"), tmp_path)
    assert found["passed"]
    assert found["sets"]["own"] == found["sets"]["all"]
    assert {name: found["sets"]["own"][name] for name in ("files", "refused", "load", "things", "crashes", "srdf_found")} == {
        "files": 3, "refused": 1, "load": 2, "things": 0, "crashes": 0, "srdf_found": 1
    }  # fmt: skip
    assert found["refused"]["own/broken.urdf"].startswith("broken.urdf:1: not well-formed")
    written = (tmp_path / urdf_files.RECORDS).read_bytes()
    assert urdf_files.run(given(f"own={files}"), tmp_path) == found
    assert (tmp_path / urdf_files.RECORDS).read_bytes() == written
    table = (tmp_path / "urdf-files.md").read_text()
    assert "| own/sub/toy.urdf | 2 | 4 | toy.srdf: up |" in table and "| own/broken.urdf | broken.urdf:" in table
    assert urdf_files.figure(tmp_path).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["kuka_iiwa/model.urdf", "franka_panda/panda.urdf", "r2d2.urdf", "quadruped/minitaur.urdf"])
def test_frames_and_contacts_of_exact_hulls_are_those_of_the_other_reading(name: str, tmp_path: Path) -> None:
    found = compare_file(name, foreign(name), 100, 3, tmp_path)
    assert found.outcome == "loads" and found.links > 5
    assert found.frame_error < 1e-12
    assert found.contacts > 0 and found.other == 0


def test_the_peer_reads_the_file_independently(tmp_path: Path) -> None:
    """Frames and contacts of the peer follow the joints that it is given."""
    path = foreign("kuka_iiwa/model.urdf")
    robot = load_robot(path)
    peer = UrdfPeer(path, robot)
    still = peer.frames(np.zeros(7))["lbr_iiwa_link_7"]
    moved = peer.frames(np.eye(7)[1])["lbr_iiwa_link_7"]
    assert np.linalg.norm(still[:3, 3] - moved[:3, 3]) > 0.5
    folded = np.array([0.0, 2.0, 0.0, -2.09, 0.0, 2.0, 0.0])
    peer.read_shapes({frozenset(("lbr_iiwa_link_0", "lbr_iiwa_link_6")), frozenset(("lbr_iiwa_link_1", "lbr_iiwa_link_7"))})
    assert not peer.touching(np.zeros(7))
    bent = [peer.touching(folded * scale) for scale in np.linspace(0.5, 1.0, 11)]
    assert any(bent)
    assert all(depth > 0 for one in bent for depth in one.values())


def test_a_file_that_the_peer_cannot_read_is_reported(tmp_path: Path) -> None:
    path = urdf_file(tmp_path, *(line.replace('xyz="1 0 0"', 'xyz="1, 0, 0"') for line in ARM))
    robot = load_robot(path)
    with pytest.raises(PeerFailed, match="Pinocchio: "):
        UrdfPeer(path, robot)
    found = compare_file("x", path, 2, 0, tmp_path)
    assert (found.outcome, found.links, found.contacts) == ("loads", -1, -1)
    assert found.message.startswith("Pinocchio: ") and "toy.urdf" in found.message
    assert str(tmp_path) not in found.message
