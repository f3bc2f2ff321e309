# SPDX-License-Identifier: Apache-2.0
"""Calibration of cameras by looking at the own hand: postures, observations, prediction of pixels, least squares, and the result's file."""
