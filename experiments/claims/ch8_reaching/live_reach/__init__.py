# SPDX-License-Identifier: Apache-2.0
"""The learned reacher and a planner on the live robot; the module `claim` defines the experiment."""
