# SPDX-License-Identifier: Apache-2.0
"""Whole-body motions from cost functions: evolution strategies, and inverse kinematics by them (thesis chapter 3)."""
