# SPDX-License-Identifier: Apache-2.0
"""Chooses names of parts, from the words that the names of their motors have in common."""

from __future__ import annotations

import re
from collections.abc import Sequence

SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
LIMBS = {
    "leg": ("hip", "knee", "ankle", "leg", "thigh", "calf", "haa", "hfe", "kfe"),
    "arm": ("shoulder", "elbow", "wrist", "arm"),
    "head": ("neck", "head"),
}
COMMON = ("joint", "link", "motor", "actuator", "j", "robot")  # words that say nothing about a part
LONGEST = 24  # letters of a name, which stands in the keys of the bus


def names_of(groups: Sequence[Sequence[str]]) -> list[str]:
    """Return a name for each group of motors, from the words that the names of its motors have in common: "left_arm", "fl_leg", "arm_2".

    The limb that the motors' names indicate (leg, arm or head) is added if the words do not contain it. The name is "arm" if there is no
    word, and only the limb if there is one group. The names are all different and have only a-z, 0-9 and _. `groups`: for each group the
    names of its motors.
    """
    names: list[str] = []
    for motors in groups:
        name = _name(motors, len(groups) == 1)
        free, number = name, 2
        while free in names:
            free, number = f"{name}_{number}", number + 1
        names.append(free)
    return names


def _name(motors: Sequence[str], alone: bool) -> str:
    words = [_words(motor) for motor in motors]
    limb = next((limb for limb, hints in LIMBS.items() if any(_hinted(word, hints) for one in words for word in one)), "")
    if alone:
        return limb or "arm"
    shared = [word for word in words[0] if all(word in other for other in words) and word not in COMMON and not word.isdecimal()]
    shared = [SIDES.get(word, word) for word in shared]
    if limb and not any(_hinted(word, (limb,)) for word in shared):
        shared.append(limb)
    return "_".join(dict.fromkeys(shared))[:LONGEST].strip("_") or "arm"


def _hinted(word: str, hints: Sequence[str]) -> bool:
    return any(word.startswith(hint) for hint in hints)


def _words(name: str) -> list[str]:
    """Return the words of a name in lower case: of "LeftElbowPitch", "robot/left-elbow_pitch" and "left_elbow_pitch" the same three."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+", name)]
