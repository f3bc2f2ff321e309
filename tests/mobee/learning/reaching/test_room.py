from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.reaching.histories import forget, room_for


def test_an_array_that_is_long_enough_is_kept_and_another_grows_twice_as_long():
    array = np.arange(4.0)
    assert room_for(array, 3) is array
    grown = room_for(array, 4)
    assert grown.tolist() == [0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]
    assert room_for(np.zeros((2, 3), dtype=int), 2).shape == (4, 3)


@pytest.mark.parametrize(("most", "left"), [(4, "abc"), (3, "bc"), (1, "")])
def test_what_was_put_in_first_is_forgotten_until_there_is_room_for_one_more(most, left):
    found = {letter.encode(): 0 for letter in "abc"}
    forget(found, most)
    assert list(found) == [letter.encode() for letter in left]
