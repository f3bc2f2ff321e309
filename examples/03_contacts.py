# SPDX-License-Identifier: Apache-2.0
"""Print the contacts of the robot while objects are added to the world and removed."""

from __future__ import annotations

import numpy as np

import mobee

robot = mobee.load_robot("icub")
world = mobee.load_world("table")
model = mobee.Model(robot, world)


def show(what: str, q: np.ndarray, reaching: str | None = None) -> None:
    """Print the numbers of contacts of solids (bodies) and of fields (volumes around them) in a pose, and the depths of the first two.

    `what`: title of the line. `q`: posture (n,) rad. `reaching`: argument of `mobee.Model.evaluate`.
    """
    pose = model.evaluate(q, reaching=reaching)
    print(f"{what}: {pose.count} solid contacts, {len(pose.contacts) - pose.count} of fields")
    for contact in pose.contacts[:2]:
        print(f"    {contact.kind} {contact.first} in {contact.second}: {1000 * contact.depth:.0f} mm, normal {contact.normal.round(2)}")


print("the world:", ", ".join(f"{thing.name} ({thing.kind}, {thing.role})" for thing in world.objects.values()))
show("at home", robot.home)

low = robot.home.copy()
low[robot.motor_index("l_shoulder_pitch")] = np.deg2rad(-20)
show("left hand low", low)

# Add an object: a post at the position of the hand.
palm = model.evaluate(robot.home).position("left_palm")
world.add("post", mobee.cylinder(0.02, 0.3), position=palm, color=(0.2, 0.3, 0.8))
show("a post at the left palm", robot.home)

# A ghost is drawn, but has no contacts.
world.set_role("post", "ghost")
show("the post as a ghost", robot.home)

# A target is an obstacle for all links except the hand that reaches for it.
world.set_role("post", "target")
for hand in ("right_palm", "left_palm"):
    show(f"the post as the target of {hand}", robot.home, reaching=hand)

# An attached object moves with a link, and has no contact with that link.
model.attach("post", "l_hand", robot.home)
world.follow(model.evaluate(low))  # the present pose of the robot
world.detach("post")
print(f"carried and let go, the post is at {world.objects['post'].position.round(3)} m")

world.remove("post")
print(f"removed; {world.version} edits so far. Other threads may edit while the model evaluates.")

# Learning needs the contact counts of many poses at once.
counts = model.evaluate(np.random.default_rng(0).uniform(*robot.limits.T, size=(50, len(robot.motors)))).count
print(f"of 50 random poses {np.count_nonzero(counts)} are in solid contact")
