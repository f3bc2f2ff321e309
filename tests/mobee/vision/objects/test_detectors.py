# SPDX-License-Identifier: Apache-2.0
"""Detectors by name, and what the one by colour finds in drawn pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mobee import InvalidValue, UnknownName, World, capsule, load_world, sphere
from mobee.rendering.scene import Scene, clutter, room
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraErrors, Cameras, CameraSettings
from mobee.vision.objects.detection import Detection
from mobee.vision.objects.detectors import by_network, detector_of
from mobee.vision.objects.learned.network import network_of
from mobee.vision.objects.placing import eyes_at, locate_all
from mobee.vision.objects.thing import Thing, things_in
from tests.mobee.vision.calibration.synthetic import RIG, ROBOT
from tests.mobee.vision.objects.drawn import THINGS

WORLD = load_world("things")
BLUE = (13, 76, 217)


def picture_with(color: tuple[int, int, int], brightness: float = 1.0) -> np.ndarray:
    """A disc of radius 20 px about (150, 100), with soft edges, before grey."""
    columns, rows = np.meshgrid(np.arange(320), np.arange(240))
    share = np.clip(20.5 - np.hypot(columns - 150.0, rows - 100.0), 0.0, 1.0)[..., None]
    return (share * brightness * np.array(color) + (1.0 - share) * 120.0).astype(np.uint8)


def test_the_things_of_a_world_are_its_targets_with_a_colour_wherever_they_are() -> None:
    assert [(one.name, one.kind, one.size) for one in things_in(WORLD)] == [(one.name, one.kind, one.size) for one in THINGS]
    bare = World()
    bare.add("ball", sphere(0.03), role="target")
    bare.add("stick", capsule(0.02, 0.1), role="target", color=(1, 0, 0))
    assert things_in(bare) == []


def nothing(things: object) -> object:
    return lambda picture: []


def test_a_detector_is_chosen_by_name_by_module_and_name_or_given() -> None:
    picture = picture_with(BLUE)
    assert [one.name for one in detector_of("color", THINGS)(picture)] == ["cup"]
    assert detector_of(f"{__name__}:nothing", THINGS)(picture) == []
    assert detector_of(nothing, THINGS)(picture) == []  # type: ignore[arg-type]
    with pytest.raises(UnknownName, match="Did you mean 'color'"):
        detector_of("colour", THINGS)
    with pytest.raises(InvalidValue, match="cannot be called"):
        detector_of("mobee.vision.objects.detectors:DETECTORS", THINGS)


@pytest.mark.parametrize("wrong", [picture_with(BLUE)[..., 0], picture_with(BLUE) / 255.0, None], ids=["grey", "floats", "none"])
def test_what_is_no_picture_in_colour_is_refused_by_the_detectors(wrong: Any) -> None:
    outputs = np.zeros((8, len(THINGS))), np.zeros(len(THINGS))
    network = network_of(THINGS, (np.zeros((150, 8)), np.zeros(8)), (np.zeros((8, 8)), np.zeros(8)), outputs)
    for detect in (detector_of("color", THINGS), by_network(network, THINGS)):
        with pytest.raises(InvalidValue, match=r"the picture is .* of uint8"):
            detect(wrong)


@pytest.mark.parametrize("brightness", [0.5, 1.0])
def test_an_outline_is_exact_to_a_fraction_of_a_pixel_in_light_and_shade(brightness: float) -> None:
    (found,) = detector_of("color", THINGS)(picture_with(BLUE, brightness))
    assert isinstance(found, Detection) and found.confidence > 0.9
    radii = np.linalg.norm(found.outline - (150.0, 100.0), axis=1)
    assert abs(radii.mean() - 20.0) < 0.15 and radii.std() < 0.25
    np.testing.assert_allclose(found.centre, (150.0, 100.0), atol=0.2)


def test_other_colours_pale_and_dark_ones_are_not_found() -> None:
    detect = detector_of("color", THINGS)
    for color in ((200, 200, 40), (150, 110, 110), (128, 128, 128), (1, 4, 10)):
        assert detect(picture_with(color)) == []


@pytest.mark.parametrize("color", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.4, 0.4, 0.42)])
def test_a_thing_whose_colour_has_no_hue_is_left_out_with_a_warning(color: tuple[float, float, float]) -> None:
    grey = Thing("pot", "sphere", (0.03,), color)
    with pytest.warns(UserWarning, match="cannot find 'pot': its colour .* has no hue"):
        detect = detector_of("color", [grey, *THINGS])
    assert [one.name for one in detect(picture_with(BLUE))] == ["cup"]


def test_what_is_cut_by_the_border_has_less_confidence_and_a_torn_region_is_left_out() -> None:
    detect = detector_of("color", [Thing("cup", "cylinder", (0.035, 0.09), (0.05, 0.3, 0.85))])
    whole, cut = detect(picture_with(BLUE))[0], detect(picture_with(BLUE)[:, 150:])[0]
    assert cut.confidence < 0.8 * whole.confidence and cut.outline[:, 0].min() > 0.4
    torn = picture_with(BLUE)
    torn[95:, 145:155] = 120
    torn[97:103] = 120
    assert all(one.area < 0.5 * whole.area for one in detect(torn))


def test_ball_cup_and_box_are_located_in_pictures_of_imperfect_cameras(rng: np.random.Generator) -> None:
    settings = CameraSettings(samples=2)
    around = [*room(3), *clutter(WORLD.objects.values(), 3)]
    eyes = Cameras(Scene(ROBOT, WORLD, RIG.cameras, around=around), settings, CameraErrors.none(ROBOT, list(RIG.cameras)), 3)
    detect, solids = detector_of("color", THINGS), [one for one in WORLD.objects.values() if one.role == "obstacle"]
    for pan in (0.0, 0.2, -0.2):
        q = ROBOT.home.copy()
        q[list(RIG.head)] = [-0.454, 0.0, pan, -0.314, 0.0, 0.192]
        pictures = {name: eyes.expose(name, [q] * settings.samples) for name in RIG.cameras}
        moment = Moment(q, np.zeros(len(q)), np.full(len(q), 1e-6))
        found = locate_all(
            THINGS, {name: detect(one) for name, one in pictures.items()}, eyes_at(RIG, np.zeros(len(RIG.names)), moment), solids
        )
        assert sorted(one.name for one in found) == ["ball", "box", "cup"]
        for one in found:
            true = WORLD.objects[one.name]
            assert np.linalg.norm(one.position - true.position) < 0.008
            np.testing.assert_allclose(one.size, true.size, rtol=0.12)
