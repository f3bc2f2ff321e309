# SPDX-License-Identifier: Apache-2.0
"""docs/law.md, "Add a force", followed from outside the project."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SECTION = re.search(r"^## Add a force\n.*?(?=^## )", (ROOT / "docs/law.md").read_text(), re.DOTALL | re.MULTILINE)
SAME = """
import numpy as np
import mobee
from my_forces import VISCOUS

model = mobee.Model(mobee.load_robot("icub"), mobee.load_world("table"))
plant, alone = mobee.OfflinePlant(model, seed=0, terms=[VISCOUS]), mobee.Controller(model, terms=[VISCOUS])
goal = plant.robot.home.copy()
goal[plant.robot.part("left_arm").slice][:4] = -0.2, 0.3, 0.5, 0.9
plant.controller.attractor = alone.attractor = goal
trace = plant.run(80)
commanded = [alone.step(q, plant.dt).velocity for q in trace.encoders]
print(np.array_equal(commanded, trace.velocity), np.array_equal(alone.last_forces["viscous"], plant.controller.last_forces["viscous"]))
print(bool(np.abs(alone.last_forces.viscous).max() > 0.01), list(alone.last_forces))

from bus_schema import VERSION, decode, encode, encoding_of
from bus_schema.messages import Forces

header = {"v": VERSION, "run": "r", "src": "controller", "seq": 0, "k": 80, "t": 0, "tw": 0}
rows = {name: force.tolist() for name, force in alone.last_forces.items()}
said = Forces(**header, re_k=80, terms=rows, part_age={}, touched={})
heard = decode(Forces, encode(said), encoding_of(Forces), robot=len(goal))
back = mobee.Forces(**{name: np.array(row) for name, row in heard.terms.items()})
print(np.array_equal(back.viscous, alone.last_forces.viscous), np.array_equal(back.total, alone.last_forces.total))
"""


def run(folder: Path, code: str) -> list[str]:
    here = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}
    ended = subprocess.run([sys.executable, "-c", code], cwd=folder, env=here, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.splitlines()


def written(folder: Path) -> str:
    """The file of the section is in the folder; the program that uses it."""
    assert SECTION
    (program,) = re.findall(r"^```python\n(.*?)^```$", SECTION[0], re.DOTALL | re.MULTILINE)
    for name, text in re.findall(r"^```python (\S+)\n(.*?)^```$", SECTION[0], re.DOTALL | re.MULTILINE):
        (folder / name).write_text(text)
    return str(program)


def test_the_arm_moves_slower_into_contact_with_it(tmp_path: Path) -> None:
    without, with_it = run(tmp_path, written(tmp_path))
    assert SECTION and f"It prints {without.split()[7]} and {with_it.split()[7]} s." in SECTION[0]
    assert without.endswith(" limits, constraints, collision") and with_it.endswith(" limits, constraints, collision, viscous")
    assert float(with_it.split()[7]) > 1.4 * float(without.split()[7])


def test_plant_and_controller_agree_with_it_and_the_bus_carries_it(tmp_path: Path) -> None:
    written(tmp_path)
    same, acts, carried = run(tmp_path, SAME)
    assert same == "True True"
    assert acts == "True ['limits', 'constraints', 'collision', 'viscous']"
    assert carried == "True True"
