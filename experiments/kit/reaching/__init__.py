# SPDX-License-Identifier: Apache-2.0
"""Common code of the experiments on reaching: the arm, its targets, learners, the planner peer, and measured true outcomes."""
