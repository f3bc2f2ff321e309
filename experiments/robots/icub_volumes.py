# SPDX-License-Identifier: Apache-2.0
"""Volumes of the iCub that are chosen by hand: force fields, and boxes that fit the meshes better than one primitive per link.

Positions are in m, in the root frame, with the robot in its zero pose.  Of the arms, only the left one's fields are listed; those
of the right arm are their mirror images (y is negated).

The fields are few spheres and capsules around the solids of each body section. They extend beyond the solids by 5 to 7 cm at hand and
fingers, 5 cm at the forearm, 3 to 4 cm at elbow, torso and head, and 3 cm at the upper arm. At the flanks of pelvis and chest it is only
1 cm, because an arm hangs beside them at home.

The entry models.icub_v2_5 of the JSON data encloses the pelvis in a box, the chest in a cylinder and the head in a sphere. They
have 1.5 to 1.7 times the volume of the convex hull of the mesh, and pelvis and upper arm would touch at home. BOXES replaces them. The mesh
in icub-models (CC BY-SA 4.0) is cut horizontally into slices; each box is the bounding box of a slice, rounded outwards to 1 mm.
"""

from __future__ import annotations

Point = tuple[float, float, float]
Field = tuple[str, str, float, Point, Point]  # name, link, radius, one end, other end (equal: a sphere)

TRUNK: list[Field] = [
    ("pelvis_field", "root_link", 0.095, (0.03, -0.045, -0.045), (0.03, 0.045, -0.045)),
    ("pelvis_back_field", "root_link", 0.095, (0.06, 0.0, -0.03), (0.06, 0.0, -0.11)),
    ("pelvis_front_field", "root_link", 0.085, (0.0, 0.0, -0.04), (0.0, 0.0, -0.12)),
    ("lower_torso_field", "torso_1", 0.085, (0.0075, 0.0, 0.023), (0.0075, 0.0, 0.023)),
    ("waist_field", "torso_2", 0.085, (0.0, 0.0, 0.04), (0.0, 0.0, 0.11)),
    ("belly_field", "chest", 0.09, (-0.03, -0.025, 0.10), (-0.03, 0.025, 0.10)),
    ("breast_field", "chest", 0.09, (-0.035, -0.04, 0.18), (-0.035, 0.04, 0.18)),
    ("back_field", "chest", 0.11, (0.12, -0.02, 0.11), (0.12, 0.02, 0.11)),
    ("shoulder_blades_field", "chest", 0.11, (0.12, -0.045, 0.185), (0.12, 0.045, 0.185)),
    ("flank_field", "chest", 0.09, (0.035, -0.04, 0.10), (0.035, 0.04, 0.10)),
    ("shoulder_girdle_field", "chest", 0.09, (0.035, -0.045, 0.19), (0.035, 0.045, 0.19)),
]
HEAD: list[Field] = [
    ("face_field", "head", 0.11, (-0.03, 0.0, 0.325), (-0.025, 0.0, 0.375)),
    ("back_of_head_field", "head", 0.117, (0.03, 0.005, 0.33), (0.025, 0.005, 0.375)),
]
LEFT_ARM: list[Field] = [
    ("shoulder_field", "shoulder_1", 0.07, (-0.0106, -0.1094, 0.1748), (-0.0106, -0.1094, 0.1748)),
    ("upper_arm_field", "shoulder_3", 0.085, (-0.011, -0.1095, 0.095), (-0.011, -0.1095, 0.045)),
    ("elbow_field", "shoulder_3", 0.085, (-0.021, -0.1064, 0.005), (-0.021, -0.1064, 0.005)),
    ("forearm_field", "forearm", 0.096, (-0.006, -0.108, -0.03), (-0.006, -0.108, -0.11)),
    ("palm_field", "hand", 0.09, (-0.011, -0.096, -0.14), (-0.011, -0.096, -0.175)),
    ("fingers_field", "hand", 0.085, (-0.03, -0.093, -0.245), (0.012, -0.092, -0.245)),
    ("thumb_field", "hand", 0.08, (-0.08, -0.083, -0.192), (-0.08, -0.083, -0.192)),
]
# Fields only, the solids there are tested: an upper arm hangs beside the trunk, a bowed head comes near waist and shoulders.
BESIDE = [
    *((f"{side}_shoulder_{k}", trunk) for side in "lr" for k in (1, 3) for trunk in ("root_link", "torso_1", "torso_2")),
    *(("head", neighbour) for neighbour in ("torso_2", "l_shoulder_1", "r_shoulder_1")),
]

Corner = tuple[float, float, float]

BOXES: dict[str, list[tuple[Corner, Corner]]] = {
    "root_link": [
        ((-0.028, -0.075, -0.156), (0.101, 0.075, -0.088)),
        ((-0.042, -0.111, -0.088), (0.104, 0.111, -0.014)),
        ((-0.032, -0.105, -0.016), (0.093, 0.105, 0.006)),
        ((-0.032, -0.1, 0.004), (0.079, 0.1, 0.032)),
    ],
    "chest": [
        ((-0.079, -0.076, 0.041), (0.166, 0.076, 0.07)),
        ((-0.085, -0.097, 0.07), (0.191, 0.097, 0.155)),
        ((-0.085, -0.122, 0.155), (0.194, 0.122, 0.19)),
        ((-0.078, -0.096, 0.19), (0.193, 0.096, 0.22)),
        ((-0.057, -0.085, 0.22), (0.183, 0.085, 0.247)),
        ((-0.031, -0.045, 0.247), (0.029, 0.045, 0.274)),
    ],
    "head": [
        ((-0.093, -0.066, 0.268), (0.089, 0.066, 0.292)),
        ((-0.1, -0.077, 0.292), (0.111, 0.093, 0.385)),
        ((-0.091, -0.076, 0.385), (0.107, 0.077, 0.43)),
        ((-0.068, -0.061, 0.43), (0.079, 0.061, 0.453)),
    ],
}
