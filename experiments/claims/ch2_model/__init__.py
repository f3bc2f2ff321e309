# SPDX-License-Identifier: Apache-2.0
"""Thesis chapter 2: the model of robot and world."""
