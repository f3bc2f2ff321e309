# SPDX-License-Identifier: Apache-2.0
"""Calibration of cameras on the robot's own hand: postures, observations, prediction of pixels, least squares, and the file."""
