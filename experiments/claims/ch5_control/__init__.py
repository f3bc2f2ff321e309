# SPDX-License-Identifier: Apache-2.0
"""Thesis chapter 5: the control law of MoBeE 2.0."""
