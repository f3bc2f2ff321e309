# SPDX-License-Identifier: Apache-2.0
"""Every message is decoded as it was encoded; an invalid message is refused with the reason."""

from __future__ import annotations

import inspect
import types
import typing
from typing import Any, Literal, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Meta, Struct

from bus_schema import VERSION, Refused, decode, encode, encoding_of, messages, rpc
from bus_schema.messages import Clock, Command, Contacts, Forces, State

NOT_SENT = {messages.Message, rpc.Request, rpc.Reply, messages.MarkerPose, messages.ContactItem}
NOT_SENT |= {
    messages.Geometry,
    messages.Surprise,
    messages.ObjectTruth,
    rpc.ObjectState,
    messages.PartStatus,
    messages.Order,
    messages.Answer,
}


def sent_types() -> list[type[Struct]]:
    found = [
        cls
        for module in (messages, rpc)
        for _, cls in inspect.getmembers(module, inspect.isclass)
        if issubclass(cls, Struct) and cls.__module__ == module.__name__
    ]
    return [cls for cls in found if cls not in NOT_SENT]


TYPES = sent_types()
LENGTHS = {"part": 3, "robot": 5}


def values(hint: Any, metas: tuple[Meta, ...] = ()) -> st.SearchStrategy[Any]:
    """What a field of this type may hold."""
    if get_origin(hint) is typing.Annotated:
        inner, *more = get_args(hint)
        return values(inner, (*metas, *(m for m in more if isinstance(m, Meta))))
    if get_origin(hint) is Literal:
        return st.sampled_from(get_args(hint))
    if get_origin(hint) in (typing.Union, types.UnionType):
        return st.one_of(*(values(one) for one in get_args(hint)))

    def bound(*names: str) -> Any:
        return next((v for m in metas for n in names if (v := getattr(m, n)) is not None), None)

    if get_origin(hint) is list:
        fixed = next((LENGTHS[m.extra["length"]] for m in metas if m.extra), None)
        low, high = (fixed, fixed) if fixed else (bound("min_length") or 0, bound("max_length") or 4)
        return st.lists(values(get_args(hint)[0]), min_size=low, max_size=high)
    if get_origin(hint) is dict:
        return st.dictionaries(values(get_args(hint)[0]), values(get_args(hint)[1]), max_size=3)
    if isinstance(hint, type) and issubclass(hint, Struct):
        return structs(hint)
    plain: dict[Any, st.SearchStrategy[Any]] = {
        bool: st.booleans(),
        type(None): st.none(),
        bytes: st.binary(max_size=20),
        str: st.text(min_size=bound("min_length") or 0, max_size=min(bound("max_length") or 20, 64)),
        float: st.floats(allow_nan=False, allow_infinity=False, min_value=1e-6 if bound("gt") == 0 else bound("ge"), max_value=bound("le")),
        int: st.integers(-(2**63) if bound("ge", "gt") is None else 1, bound("le") or 2**62),
    }
    return plain[hint]


def structs(cls: type[Struct]) -> st.SearchStrategy[Struct]:
    hints = get_type_hints(cls, include_extras=True)
    fields = {name: st.just(VERSION) if name == "v" else values(hint) for name, hint in hints.items() if name in cls.__struct_fields__}
    return st.builds(cls, **fields)


def check(message: Struct, **lengths: int) -> Struct:
    return decode(type(message), encode(message), encoding_of(type(message)), **lengths)


@pytest.mark.parametrize("cls", TYPES, ids=lambda cls: cls.__name__)
@settings(max_examples=25)
@given(data=st.data())
def test_every_message_survives_the_wire(cls: type[Struct], data: st.DataObject) -> None:
    message = data.draw(structs(cls))
    assert check(message, **LENGTHS) == message


HEADER: dict[str, Any] = {"v": VERSION, "run": "r", "src": "s", "seq": 0, "k": 7, "t": 70, "tw": 1}


def command(**fields: Any) -> Command:
    return Command(**{**HEADER, "epoch": 1, "re_k": 7, "mode": "velocity", "ref": [0.1, 0.2, 0.3], "ttl": 100, **fields})


def reason_of(cls: type[Struct], payload: bytes, encoding: str | None = None, **lengths: int) -> str:
    with pytest.raises(Refused) as caught:
        decode(cls, payload, encoding_of(cls) if encoding is None else encoding, **lengths)
    assert cls.__name__ in str(caught.value)
    return caught.value.reason


def test_a_message_of_another_type_is_refused() -> None:
    assert reason_of(Command, encode(command()), encoding_of(State)) == "type"
    for encoding in ("", "application/json", "zenoh/bytes", "application/msgpack;icub/Command", "application/msgpack;icub/Command/"):
        assert reason_of(Command, encode(command()), encoding) == "type"


def test_another_version_is_refused_by_the_encoding_and_by_the_header() -> None:
    assert reason_of(Command, encode(command()), f"application/msgpack;icub/Command/{VERSION + 1}") == "version"
    assert reason_of(Command, encode(command(v=VERSION + 1))) == "version"


def test_a_missing_an_unknown_and_a_wrong_field_are_refused() -> None:
    right = msgspec.to_builtins(command())
    for wrong in (
        {name: value for name, value in right.items() if name != "ttl"},
        {**right, "extra": 1},
        {**right, "ref": "none"},
        {**right, "mode": "fly"},
        {**right, "ttl": 0},  # must not mean "indefinitely"
        {**right, "ttl": 1001},
        {**right, "seq": -1},
        {**right, "run": ""},
        {**right, "t": 2**63},
    ):
        assert reason_of(Command, msgspec.msgpack.encode(wrong)) == "decode"


def test_a_wrong_number_of_motors_is_refused() -> None:
    assert check(command(), part=3) == command()
    assert reason_of(Command, encode(command()), part=4) == "length"
    assert reason_of(Command, encode(command(ref=[])), part=3) == "length"
    rows = {"limits": [0.0] * 5, "viscous": [0.0] * 5}
    assert check(_forces(terms=rows), robot=5) == _forces(terms=rows)
    assert reason_of(Forces, encode(_forces(terms={**rows, "collision": [0.0] * 4})), robot=5) == "length"


def test_an_optional_vector_is_checked_when_it_is_there() -> None:
    def force(f: list[float] | None) -> rpc.Force:
        return rpc.Force(v=VERSION, id="1", who="w", epoch=1, f=f)

    assert check(force(None), part=3) == force(None)
    assert reason_of(rpc.Force, encode(force([1.0])), part=3) == "length"


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
def test_no_number_that_is_not_finite_passes_wherever_it_stands(bad: float) -> None:
    for place in range(3):
        ref = [0.1, 0.2, 0.3]
        ref[place] = bad
        assert reason_of(Command, encode(command(ref=ref)), part=3) == "value"
    assert reason_of(Command, encode(command(ref=[float("inf"), float("-inf"), 0.0]))) == "value"
    truth = messages.Truth(**HEADER, q=[], depth=bad, pair="", gap=0.0, objects=[])
    assert reason_of(messages.Truth, encode(truth)) == "value"
    item = messages.ContactItem(
        first="a", second="b", kind="solid", depth=0.0, point=[0.0, bad, 0.0], normal=[0.0, 0.0, 1.0], first_link=0, second_link=-1
    )
    assert reason_of(Contacts, encode(Contacts(**HEADER, re_k=7, contacts=[item]))) == "value"
    event = messages.Event(**HEADER, level="info", code="c", text="t", values={"x": bad})
    assert reason_of(messages.Event, encode(event)) == "value"


@pytest.mark.parametrize("rate", [0.0, -1.0, 1e308])
def test_a_clock_that_does_not_go_forward_is_refused(rate: float) -> None:
    """Receivers divide by the rate."""
    assert reason_of(Clock, encode(Clock(**HEADER, dt=10, mode="free", rate=rate))) == "decode"


def test_large_numbers_whose_sum_overflows_are_finite() -> None:
    assert check(command(ref=[1e308, 1e308, 1e308])).ref == [1e308] * 3


def test_differences_of_two_times_that_passed_can_be_sent() -> None:
    latest = check(command(t=2**62)).t
    assert decode(Forces, encode(_forces(part_age={"torso": 0 - latest, "head": latest})), encoding_of(Forces))


def _forces(**fields: Any) -> Forces:
    empty: dict[str, Any] = {"re_k": 7, "terms": {}, "part_age": {}, "touched": {}}
    return Forces(**HEADER, **{**empty, **fields})


def test_random_and_corrupted_bytes_are_refused_or_right_and_nothing_else(rng: np.random.Generator) -> None:
    """20000 payloads: nothing but Refused is ever raised, and what passes is finite and of the right length."""
    ones = [1.0, -1.5, 1.9]  # one changed byte makes NaN or infinity of each
    right = (command(ref=ones), _forces(terms={"limits": ones}), Clock(**HEADER, dt=10, mode="free", rate=1.0))
    samples = [(type(one), encode(one)) for one in right]
    passed, reasons = 0, set()
    for trial in range(20_000):
        cls, payload = samples[trial % len(samples)]
        data = bytearray(payload if trial % 4 else rng.bytes(int(rng.integers(0, 200))))
        if trial % 4:
            for at in rng.integers(0, len(data), 1 + trial // 4 % 3):
                data[at] = rng.integers(256)
        try:
            message = decode(cls, bytes(data), encoding_of(cls), part=3)
        except Refused as refused:
            reasons.add(refused.reason)
            continue
        passed += 1
        numbers = [x for name in message.__struct_fields__ for x in np.ravel(getattr(message, name)) if isinstance(x, float)]
        assert np.isfinite(numbers).all()
    assert passed > 1000  # a changed digit is no reason: else this test shows nothing
    assert reasons >= {"decode", "version", "value"}


def test_deeply_nested_bytes_are_refused() -> None:
    assert reason_of(Command, b"\x91" * 100_000) == "decode"
