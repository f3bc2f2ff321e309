# SPDX-License-Identifier: Apache-2.0
"""The target locator: finds the red ball in both eye images and publishes its position in the root frame.

Reads: clock (for the id of the run), vision/image/{left,right}, vision/camera/{left,right}.
Writes: world/ball.
"""
