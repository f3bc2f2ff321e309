# SPDX-License-Identifier: Apache-2.0
"""Reads robots from URDF and SRDF files."""
