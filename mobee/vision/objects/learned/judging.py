# SPDX-License-Identifier: Apache-2.0
"""Measures the quality of a detector on labelled pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from mobee.vision.objects.detection import Detection, Detector
from mobee.vision.objects.learned.pictures import Labelled
from mobee.vision.objects.outlining import outlined

NEAR = 2.0  # px between the middles of a true outline and of one that counts as the same
WHOLE = 0.99  # share of an outline within the picture, and of its hull that is filled, of a thing that must be found


@dataclass(frozen=True, slots=True)
class Quality:
    """The quality of a detector on labelled pictures.

    `pictures`: number of pictures. `found`: by name of the thing, the share of its wholly visible outlines that were found; NaN if there
    were no such outlines. An outline is found if the middle of a detection of the thing is less than 2 px from the middle of the outline.
    `error`: median of this distance over the found outlines, px. `false_regions`: number of detections per picture whose middle does not
    show the thing. `seconds`: processor time per picture.
    """

    pictures: int
    found: dict[str, float]
    error: float
    false_regions: float
    seconds: float


def judge(detect: Detector, names: Sequence[str], pictures: Sequence[Labelled]) -> Quality:
    """Measure the quality of a detector on labelled pictures.

    `names`: names of the N things, in the order of the last axis of `Labelled.shares` (H, W, N).
    """
    errors: dict[str, list[float]] = {name: [] for name in names}
    false, seconds = 0, 0.0
    for one in pictures:
        begin = process_time()
        detections = list(detect(one.picture))
        seconds += process_time() - begin
        for number, name in enumerate(names):
            own = [detection for detection in detections if detection.name == name]
            false += sum(not _shows(one, detection, number) for detection in own)
            for true in outlined(name, one.shares[..., number]):
                if true.confidence > WHOLE:
                    errors[name].append(min((float(np.linalg.norm(found.centre - true.centre)) for found in own), default=np.inf))
    near = np.array([error for some in errors.values() for error in some if error < NEAR])
    return Quality(
        len(pictures),
        {name: float(np.mean(np.array(some) < NEAR)) if some else float("nan") for name, some in errors.items()},
        float(np.median(near)) if len(near) else float("nan"),
        false / len(pictures),
        seconds / len(pictures),
    )


def _shows(one: Labelled, detection: Detection, number: int) -> bool:
    """Return whether a picture shows a thing in the middle of a detection."""
    column, row = np.round(detection.centre).astype(int)
    return bool(one.shares[row, column, number] >= 0.5)
