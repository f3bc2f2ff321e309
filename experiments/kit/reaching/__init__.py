# SPDX-License-Identifier: Apache-2.0
"""Common code of the experiments on reaching: the arm, its targets, learners, the planner to compare with, and measured true outcomes."""
