# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import defusedxml.ElementTree
import pytest

from mobee.errors import MobeeError
from mobee.robot import icub_urdf
from mobee.robot.load import load_robot


@pytest.fixture
def urdf(tmp_path: Path) -> ET.Element:
    root: ET.Element = defusedxml.ElementTree.parse(icub_urdf.write_upper_body_urdf(tmp_path / "icub.urdf")).getroot()
    return root


def test_legs_sensors_and_frames_are_gone_and_the_palms_stay(urdf: ET.Element) -> None:
    links = {link.attrib["name"] for link in urdf.iter("link")}
    assert not any(word in link for link in links for word in ("leg", "foot", "hip", "ankle", "imu", "ems"))
    assert {"l_hand_dh_frame", "r_hand_dh_frame", "root_link", "head"} <= links
    assert len(links) == 25
    assert {child.tag for child in urdf} == {"link", "joint"}


def test_its_twenty_joints_are_motors_of_the_icub(urdf: ET.Element) -> None:
    moving = [joint.attrib["name"] for joint in urdf.iter("joint") if joint.get("type") == "revolute"]
    assert len(moving) == 20
    assert set(moving) <= set(load_robot("icub").motors)


def test_its_links_are_called_as_the_icubs(urdf: ET.Element) -> None:
    rigid = {"l_upper_arm", "r_upper_arm", "l_hand_dh_frame", "r_hand_dh_frame"}
    assert {link.attrib["name"] for link in urdf.iter("link")} - rigid <= set(load_robot("icub").links)


def test_every_mesh_is_an_existing_file_and_every_link_has_a_mass(urdf: ET.Element) -> None:
    meshes = [Path(mesh.attrib["filename"]) for mesh in urdf.iter("mesh")]
    assert meshes and all(mesh.is_absolute() and mesh.is_file() for mesh in meshes)
    masses = {link.attrib["name"]: float(link.find("inertial/mass").attrib["value"]) for link in urdf.iter("link")}
    assert all(mass > 0 for mass in masses.values())
    assert masses["l_hand_dh_frame"] < 1e-3


def test_a_missing_package_is_named_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "icub_models", None)
    with pytest.raises(MobeeError, match=r'pip install "mobee\[sim\]"'):
        icub_urdf.models_folder()
