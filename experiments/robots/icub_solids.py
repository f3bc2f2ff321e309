"""Solids of the iCub that follow its meshes closer than one primitive a link.

Data models.icub_v2_5 encloses pelvis, chest and head in one box, cylinder and sphere of 1.5 to 1.7 times the hull's volume, so
that pelvis and upper arm would touch at home. These boxes are the bounds, rounded outwards to 1 mm, of what a mesh of icub-models
(CC BY-SA 4.0) holds between horizontal cuts; zero pose, root frame, [m].
"""

from __future__ import annotations

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
