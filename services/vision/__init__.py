# SPDX-License-Identifier: Apache-2.0
"""The target locator: finds the red ball in the pictures of two cameras and publishes its position in the root frame.

Reads: clock (for the id of the run), vision/image/{camera}, vision/camera/{camera}.
Writes: world/ball.
"""
