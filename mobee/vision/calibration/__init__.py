# SPDX-License-Identifier: Apache-2.0
"""Calibration of a robot's cameras with pictures of its own hand: postures, observations, predicted pixels, least squares, and the file."""
