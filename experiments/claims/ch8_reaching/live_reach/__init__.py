# SPDX-License-Identifier: Apache-2.0
"""The learned reacher and a planner on the live robot; `claim` is the experiment."""
