# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics: finds poses that minimise a cost, by natural evolution strategies or least squares (thesis 3.2)."""
