# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee import Roadmap
from mobee.learning.record import space_from
from mobee.roadmap.adaptive.adaptive import roadmap_space
from tests.mobee.planar import planar_arm

Q = np.array([[0.0, 0.1, 0.4], [0.5, 0.1, 0.4], [0.5, 0.6, 0.4], [2.0, 0.0, 0.4], [2.0, 0.5, 0.4], [0.5, 0.1, 0.4]])
EDGES = np.array([[0, 1], [1, 2], [2, 5], [3, 4]])


def roadmap(motors=("m0", "m1")) -> Roadmap:
    return Roadmap(mobee.Model(planar_arm()), Q, Q[:, :1], EDGES, np.array([0.1]), {"motors": list(motors)})


def test_states_are_the_poses_of_the_largest_part_and_actions_its_edges_in_both_directions():
    space = roadmap_space(roadmap())
    assert np.array_equal(space.samples, Q[:3, :2])  # vertex 5 is the pose of vertex 1
    assert space.goals.tolist() == [[1, -1], [0, 2], [1, -1]]
    assert space.joints == ("m0", "m1")


def test_other_motors_of_the_part_rest_where_the_map_has_them_and_settings_make_it_again():
    space = roadmap_space(roadmap())
    assert space.target(2) == pytest.approx(Q[2])
    again = space_from(space.settings, planar_arm())
    assert np.array_equal(again.target(2), space.target(2))


def test_a_curious_agent_learns_on_it():
    space = roadmap_space(roadmap())
    agent = mobee.CuriousAgent(space, mobee.OfflinePlant(mobee.Model(planar_arm())))
    agent.run(6)
    assert agent.model.tries.sum() == 6


def test_a_map_of_several_parts_needs_joints_of_one():
    robot = mobee.load_robot("icub")
    q = np.repeat(robot.home[None], 2, axis=0)
    q[1, robot.motor_index("r_elbow")] += 0.1
    several = Roadmap(mobee.Model(robot), q, q[:, :1], np.array([[0, 1]]), np.ones(1), {})
    with pytest.raises(mobee.InvalidValue, match=r"give joints=\[...\] of one"):
        roadmap_space(several)
    assert len(roadmap_space(several, ["r_elbow"])) == 2
    with pytest.raises(mobee.InvalidValue, match="no edge between two poses"):
        roadmap_space(several, ["l_elbow"])
