# SPDX-License-Identifier: Apache-2.0
"""Common code of the experiments on reaching: arm, targets, learners, a planner for comparison, and true outcomes of reaches."""
