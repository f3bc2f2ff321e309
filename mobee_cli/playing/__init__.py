# SPDX-License-Identifier: Apache-2.0
"""Shared by `mobee play` and `mobee learn`: what learns on which robot, its files, and learning offline."""
