# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from mobee.errors import InvalidValue
from mobee.robot.load import load_robot
from services.common.config import load_config
from services.port_filter.config import Config

ROBOT = load_robot("icub")


@pytest.mark.parametrize(("clients", "namespace"), [("icub", "icub"), ("other", "other")])
def test_clients_in_the_namespace_of_the_robot_are_refused(clients: str, namespace: str) -> None:
    with pytest.raises(InvalidValue, match=f'such as "{namespace}_filtered"'):
        Config(clients=clients, namespace=namespace).check_robot(ROBOT)
    Config(clients=f"{clients}_filtered", namespace=namespace).check_robot(ROBOT)


def test_a_participant_whose_name_cannot_be_part_of_a_key_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        load_config(Config, ("--participants", "a b"), "services.port_filter")
    assert "participants" in capsys.readouterr().err
