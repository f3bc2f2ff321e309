# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

from mobee.check import check_file
from tests.mobee.robot.urdf_files import ARM, tetrahedron, urdf_file, write_stl

HAND = '<link name="hand"><visual><geometry><mesh filename="package://arms/hand.stl"/></geometry></visual></link>'
WRIST = '<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/></joint>'


def test_a_missing_mesh_that_is_drawn_is_a_finding_with_its_line(tmp_path: Path) -> None:
    path = urdf_file(tmp_path, *ARM, HAND, WRIST)
    (found,) = [finding for finding in check_file(path).findings if finding.check == "missing-meshes"]
    assert (found.severity, found.where) == ("warning", f"{path}:7")
    assert "'package://arms/hand.stl'" in found.what and str(tmp_path / "arms" / "hand.stl") in found.why
    (tmp_path / "arms").mkdir()
    write_stl(tmp_path / "arms" / "hand.stl", tetrahedron())
    assert not [finding for finding in check_file(path).findings if finding.check == "missing-meshes"]
