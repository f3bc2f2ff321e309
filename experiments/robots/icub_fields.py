"""Our own force fields of the iCub: few spheres and capsules around the solids of each body section.

Zero pose, root frame, [m]; the right arm mirrors the left in y. Margins beyond the solids: hand and fingers 6 cm, forearm 5 cm,
upper arm, torso and head 4 cm or less where the arms hang beside the trunk.
"""

from __future__ import annotations

Point = tuple[float, float, float]
Field = tuple[str, str, float, Point, Point]  # name, link, radius, one end, other end (equal: a sphere)

TRUNK: list[Field] = [
    ("lower_torso_field", "torso_1", 0.09, (0.02, -0.03, 0.02), (0.02, 0.03, 0.02)),
    ("waist_field", "torso_2", 0.08, (0.0, -0.02, 0.06), (0.0, 0.02, 0.06)),
    ("chest_front_field", "chest", 0.10, (-0.02, -0.04, 0.17), (-0.02, 0.04, 0.17)),
    ("chest_back_field", "chest", 0.12, (0.12, -0.03, 0.17), (0.12, 0.03, 0.17)),
    ("belly_field", "chest", 0.09, (-0.02, 0.0, 0.10), (-0.02, 0.0, 0.10)),
]
HEAD: list[Field] = [("head_field", "head", 0.15, (0.0015, 0.0, 0.3474), (0.0015, 0.0, 0.3474))]
LEFT_ARM: list[Field] = [
    ("upper_arm_field", "shoulder_3", 0.09, (-0.011, -0.1095, 0.11), (-0.011, -0.1095, 0.05)),
    ("elbow_field", "shoulder_3", 0.085, (-0.021, -0.1064, 0.005), (-0.021, -0.1064, 0.005)),
    ("forearm_field", "forearm", 0.095, (-0.006, -0.108, -0.03), (-0.006, -0.108, -0.11)),
    ("palm_field", "hand", 0.085, (-0.011, -0.096, -0.14), (-0.011, -0.096, -0.175)),
    ("fingers_field", "hand", 0.08, (-0.03, -0.093, -0.24), (0.012, -0.092, -0.24)),
    ("thumb_field", "hand", 0.07, (-0.07, -0.083, -0.19), (-0.07, -0.083, -0.19)),
]
