# SPDX-License-Identifier: Apache-2.0
"""Vision: lenses, imperfect cameras, positions of objects from two cameras, and calibration with pictures of the robot's own hand."""
