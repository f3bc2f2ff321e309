# SPDX-License-Identifier: Apache-2.0
"""The description of a robot, and the readers and writers of robot and world files."""
