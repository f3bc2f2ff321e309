# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse

import pytest

from experiments.kit.command_line import positive_number, positive_whole, whole, whole_from_two


def test_numbers_are_read() -> None:
    assert (whole("0"), positive_whole("7"), whole_from_two("2"), positive_number("2.5e-1")) == (0, 7, 2, 0.25)


@pytest.mark.parametrize(
    ("read", "text"),
    [(positive_whole, "0"), (positive_whole, "-1"), (positive_whole, "1.5"), (positive_whole, "²"), (whole_from_two, "1"), (whole, "-1")]
    + [(positive_number, text) for text in ("0", "-2", "nan", "inf", "few")],
)
def test_other_texts_are_refused(read, text) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=f"'{text}'"):
        read(text)
