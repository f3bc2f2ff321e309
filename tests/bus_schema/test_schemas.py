# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from bus_schema import VERSION
from bus_schema.schemas import keys, schemas_of


@pytest.mark.parametrize("key", keys())
def test_every_key_of_the_contract_has_schemas(key: str) -> None:
    found = schemas_of(key)
    assert set(found) in ({"message"}, {"request", "reply", "failure"})
    for schema in found.values():
        name = schema["$ref"].rpartition("/")[2]
        assert schema["encoding"] == f"application/msgpack;icub/{name}/{VERSION}"
        assert schema["$defs"][name]["additionalProperties"] is False


def test_a_schema_has_the_fields_of_the_struct_with_their_units() -> None:
    state = schemas_of("left_arm/state")["message"]["$defs"]["State"]
    assert state["properties"]["q"] == {"type": "array", "items": {"type": "number"}, "description": "rad, encoders"}
    assert {"v", "run", "src", "seq", "k", "t", "tw", "gate", "epoch"} <= set(state["required"])
    assert schemas_of("*/state") == schemas_of("{part}/state") == schemas_of("State") == schemas_of("left_arm/state")


def test_a_call_has_the_schemas_of_request_and_reply() -> None:
    found = schemas_of("left_arm/rpc/drive/take")
    assert "instance" in found["request"]["$defs"]["Take"]["required"]
    assert found["reply"]["$ref"] == "#/$defs/Taken"


def test_every_struct_has_a_schema_by_its_name() -> None:
    assert all(schemas_of(name) for name in ("Stat", "World", "Geometry", "PartStatus", "Failure"))


def test_a_key_that_no_message_has_has_no_schema() -> None:
    assert schemas_of("left_arm/stat") == {}
