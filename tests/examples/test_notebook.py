# SPDX-License-Identifier: Apache-2.0
"""The quickstart notebook, cell by cell, as Jupyter runs it: one namespace, top to bottom."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parents[2] / "examples" / "quickstart.ipynb"


@pytest.fixture(scope="module")
def cells() -> list[dict[str, Any]]:
    return list(json.loads(NOTEBOOK.read_text())["cells"])


def test_the_notebook_runs_from_top_to_bottom(cells: list[dict[str, Any]], capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{NOTEBOOK.name}, cell {number}", "exec"), names)
    said = capsys.readouterr().out
    assert "contacts at home: 0" in said
    assert "touching table\nsolid contacts: 0" in said
    first, last = (float(gain) for gain in re.findall(r"(0\.\d+) (?:nats at first|at last)", said))
    assert last < 0.8 * first
    assert names["missed"] and names["plan"].path[-1] == 24
    assert names["reached"].missing < 0.01


def test_the_notebook_is_stored_without_outputs(cells: list[dict[str, Any]]) -> None:
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells if cell["cell_type"] == "code")
