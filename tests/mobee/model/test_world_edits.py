# SPDX-License-Identifier: Apache-2.0
"""Any sequence of edits: the arrays that the engine reads agree with the objects, and no earlier snapshot changes."""

from __future__ import annotations

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

import mobee
from mobee.model.core_tables import VOLUME, volume_row
from mobee.model.engine import ATTACHED, ATTACHED_GHOST, GHOST, OBSTACLE, TARGET
from mobee.model.kinematics import matrix_from_quaternion
from tests.mobee.planar import planar_arm


def unit(vector):
    return vector / np.linalg.norm(vector)


ROLES = st.sampled_from(["obstacle", "target", "ghost"])
LENGTHS = st.floats(0.01, 0.5)
SHAPES = st.one_of(
    st.builds(mobee.sphere, LENGTHS),
    st.builds(mobee.capsule, LENGTHS, LENGTHS),
    st.builds(mobee.cylinder, LENGTHS, LENGTHS),
    st.builds(mobee.box, LENGTHS, LENGTHS, LENGTHS),
)
COORDINATE = st.floats(-2.0, 2.0)
POSITIONS = st.tuples(COORDINATE, COORDINATE, COORDINATE)
ROTATIONS = st.integers(0, 2**32 - 1).map(lambda seed: matrix_from_quaternion(unit(np.random.default_rng(seed).normal(size=4))))
CODES = {
    ("obstacle", False): OBSTACLE,
    ("target", False): TARGET,
    ("ghost", False): GHOST,
    ("obstacle", True): ATTACHED,
    ("target", True): ATTACHED,
    ("ghost", True): ATTACHED_GHOST,
}


class Edits(RuleBasedStateMachine):
    """The world beside a plain dictionary of what it should hold, as every evaluation should see it."""

    def __init__(self) -> None:
        super().__init__()
        self.model = mobee.Model(planar_arm())
        self.world = self.model.world
        self.expected: dict[str, dict] = {}
        self.kept: list = []
        self.made = 0

    @initialize(q=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
    def pose(self, q):
        self.q = np.array(q)
        pose = self.model.evaluate(self.q)
        self.world.follow(pose)
        self.links = pose.transforms

    def name(self, data) -> str:
        return data.draw(st.sampled_from(sorted(self.expected)))

    @rule(shape=SHAPES, position=POSITIONS, rotation=ROTATIONS, role=ROLES)
    def add(self, shape, position, rotation, role):
        name = f"thing{self.made}"
        self.made += 1
        self.world.add(name, shape, position=position, rotation=rotation, role=role)
        self.expected[name] = {"shape": shape, "position": np.array(position), "rotation": rotation, "role": role, "link": None}

    @precondition(lambda self: self.expected)
    @rule(data=st.data())
    def remove(self, data):
        name = self.name(data)
        self.world.remove(name)
        del self.expected[name]

    @precondition(lambda self: self.expected)
    @rule(data=st.data(), position=POSITIONS, rotation=ROTATIONS)
    def move(self, data, position, rotation):
        name = self.name(data)
        if self.expected[name]["link"] is not None:
            return
        self.world.move(name, position=position, rotation=rotation)
        self.expected[name].update(position=np.array(position), rotation=rotation)

    @precondition(lambda self: self.expected)
    @rule(data=st.data(), role=ROLES)
    def role(self, data, role):
        name = self.name(data)
        self.world.set_role(name, role)
        self.expected[name]["role"] = role

    @precondition(lambda self: self.expected)
    @rule(data=st.data(), link=st.integers(0, 3))
    def attach(self, data, link):
        name = self.name(data)
        self.world.attach(name, self.model.robot.links[link])
        self.expected[name]["link"] = link

    @precondition(lambda self: self.expected)
    @rule(data=st.data())
    def detach(self, data):
        name = self.name(data)
        if self.expected[name]["link"] is None:
            return
        self.world.detach(name)
        self.expected[name]["link"] = None

    @rule(q=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
    def evaluate_elsewhere(self, q):
        """An attached object moves with its link; the dictionary computes this separately."""
        before, self.q = self.links, np.array(q)
        pose = self.model.evaluate(self.q)
        self.world.follow(pose)
        self.links = pose.transforms
        for thing in self.expected.values():
            if thing["link"] is not None:
                turn = self.links[thing["link"]] @ np.linalg.inv(before[thing["link"]])
                thing["position"] = turn[:3, :3] @ thing["position"] + turn[:3, 3]
                thing["rotation"] = turn[:3, :3] @ thing["rotation"]

    @invariant()
    def arrays_agree_with_the_objects(self):
        snapshot = self.world.snapshot
        things = list(snapshot.objects.values())
        assert snapshot.names == tuple(snapshot.objects) == tuple(thing.name for thing in things)
        assert (snapshot.rows.shape, snapshot.rows.dtype) == ((len(things),), VOLUME)
        assert snapshot.rows.flags.c_contiguous
        assert snapshot.roles.dtype == np.int64
        assert snapshot.roles.tolist() == [CODES[thing.role, thing.link is not None] for thing in things]
        assert set(snapshot.attached) == {thing.name for thing in things if thing.link is not None}
        assert len(snapshot.attached) == len(set(snapshot.attached))
        for row, thing in zip(snapshot.rows, things, strict=True):
            assert row.tobytes() == volume_row(thing).tobytes()

    @invariant()
    def the_next_evaluation_sees_every_edit(self):
        if not hasattr(self, "q"):
            return
        seen = self.model.evaluate(self.q).objects
        assert list(seen) == list(self.expected)
        for name, thing in self.expected.items():
            assert (seen[name].kind, seen[name].size, seen[name].role) == (thing["shape"].kind, thing["shape"].size, thing["role"])
            np.testing.assert_allclose(seen[name].position, thing["position"], atol=1e-9)
            np.testing.assert_allclose(seen[name].rotation, thing["rotation"], atol=1e-9)

    @invariant()
    def no_snapshot_ever_changes(self):
        now = self.world.snapshot
        if not self.kept or self.kept[-1][0] is not now:
            self.kept.append((now, dict(now.objects), now.names, now.rows.copy(), now.roles.copy(), now.attached))
        for snapshot, objects, names, rows, roles, attached in self.kept:
            assert dict(snapshot.objects) == objects
            assert (snapshot.names, snapshot.attached) == (names, attached)
            assert np.array_equal(snapshot.rows, rows)
            assert np.array_equal(snapshot.roles, roles)
        assert [kept[0].version for kept in self.kept] == list(range(self.kept[0][0].version, now.version + 1))


TestEdits = Edits.TestCase
TestEdits.settings = settings(max_examples=40, stateful_step_count=25, deadline=None)
