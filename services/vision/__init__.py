# SPDX-License-Identifier: Apache-2.0
"""The locator: finds known things in the pictures of two cameras, follows them, and publishes where they are in the root frame.

Reads: clock, vision/image/{camera}, vision/camera/{camera}.
Writes: world/{object}.
"""
