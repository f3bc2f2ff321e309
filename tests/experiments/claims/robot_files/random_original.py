# SPDX-License-Identifier: Apache-2.0
"""Random robot files as they were written from 2011 to 2014."""

from __future__ import annotations

import numpy as np

VOLUMES = {"sphere": ("radius",), "cylinder": ("radius", "height"), "box": ("width", "height", "depth")}


def random_original(seed: int) -> str:
    """A tree of parts, motors that are named again, links and joints, volumes and fields, markers, clauses, a hand."""
    return _Writer(np.random.default_rng(seed)).write()


class _Writer:
    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.motors: list[str] = []
        self.own: list[str] = []  # motors of the part that is being written
        self.markers = 0

    def write(self) -> str:
        body = "".join(self._part(f"part{k}", 4) for k in range(int(self.rng.integers(1, 3))))
        head = '<?xml version="1.0" encoding="UTF-8"?>\n<!DOCTYPE ZeroPositionKinematicTree>\n'
        return f'{head}<ZeroPositionKinematicTree version="1.0" robotName="random">\n{body}</ZeroPositionKinematicTree>\n'

    def _part(self, name: str, depth: int) -> str:
        outer, self.own = self.own, []
        body = f'<link z="0.1" radius="0.02">{self._joint(max(depth, 1), new=True)}</link>\n' + self._joint(depth - 1)
        clauses = "".join(self._clause() for _ in range(2))
        self.own = outer
        return f'<bodyPart name="{name}">{body}{clauses}</bodyPart>\n'

    def _joint(self, depth: int, new: bool = False) -> str:
        """A motor and its joint; unless it has to be new, the motor is sometimes one that was defined before."""
        if depth <= 0:
            return ""
        if self.motors and not new and self.rng.random() < 0.25:
            name = f'name="{self.rng.choice(self.motors)}"'
        else:
            low, high = np.sort(self.rng.uniform(-150, 150, 2))
            self.motors.append(f"m{len(self.motors)}")
            self.own.append(self.motors[-1])
            name = f'name="{self.motors[-1]}" minPos="{low:.2f}" maxPos="{high + 5:.2f}" home="{self.rng.uniform(-200, 200):.1f}"'
        low, high = np.sort(self.rng.uniform(-90, 90, 2))
        hand = ' noSelfCollision="true"' if self.rng.random() < 0.15 else ""
        radius = self.rng.choice([0.0, 0.03])
        inside = self._bodies() + "".join(self._link(depth - 1) for _ in range(int(self.rng.integers(1, 3))))
        limits = f'minPos="{low:.2f}" maxPos="{high + 1:.2f}"'
        return f'<motor {name}><joint {self._axis()} {limits} radius="{radius}" length="0.06"{hand}>{inside}</joint></motor>\n'

    def _link(self, depth: int) -> str:
        field = f' field="{self.rng.uniform(0.03, 0.1):.3f}"' if self.rng.random() < 0.3 else ""
        hand = ' noSelfCollision="true"' if self.rng.random() < 0.1 else ""
        radius = self.rng.choice([0.0, 0.02])
        inside = self._bodies() + self._joint(depth)
        if self.rng.random() < 0.2:
            inside += self._part(f"part_in_{depth}_{len(self.motors)}", depth - 1)
        return f'<link {self._axis()} length="{self.rng.uniform(0.05, 0.2):.3f}" radius="{radius}"{field}{hand}>{inside}</link>\n'

    def _bodies(self) -> str:
        return "".join(self._volume() for _ in range(int(self.rng.integers(0, 3)))) + (self._marker() if self.rng.random() < 0.4 else "")

    def _volume(self) -> str:
        tag = str(self.rng.choice(list(VOLUMES)))
        sizes = " ".join(f'{name}="{self.rng.uniform(0.02, 0.1):.3f}"' for name in VOLUMES[tag])
        place = " ".join(f'p{axis}="{self.rng.uniform(-0.1, 0.1):.3f}"' for axis in "xyz")
        turn = "" if tag == "sphere" else f' {self._axis("h")} angle="{self.rng.uniform(-180, 180):.1f}"'
        field = ' field="True"' if self.rng.random() < 0.4 else ""
        return f"<{tag} {sizes} {place}{turn}{field}/>"

    def _marker(self) -> str:
        self.markers += 1
        normal = self._axis("n") if self.rng.random() < 0.6 else ""
        return f'<marker name="marker{self.markers // 2}" tracer="3" {normal}/>'  # every name twice

    def _axis(self, letter: str = "") -> str:
        axis = self.rng.choice([-1.0, 0.0, 1.0, 0.37], 3)
        axis[int(self.rng.integers(3))] = 1.0
        return " ".join(f'{letter}{name}="{value}"' for name, value in zip("xyz", axis, strict=True))

    def _clause(self) -> str:
        rows = "".join(self._row() for _ in range(int(self.rng.integers(1, 3))))
        return f'<constraintList>{rows}</constraintList>\n<constraint a="1" q="0" b="0"/>\n'

    def _row(self) -> str:
        motors = sorted({0, len(self.own) - 1})
        factors = " ".join(f"{self.rng.uniform(0.1, 2) * self.rng.choice([-1, 1]):.2f}" for _ in motors)
        return f'<constraint a="{factors}" q="{" ".join(map(str, motors))}" b="{self.rng.uniform(-100, 100):.1f}"/>'
