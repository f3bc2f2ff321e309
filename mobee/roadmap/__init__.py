# SPDX-License-Identifier: Apache-2.0
"""Whole-body motions from cost functions: evolution strategies, inverse kinematics, and roadmaps (thesis chapter 3)."""
