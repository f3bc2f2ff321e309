# SPDX-License-Identifier: Apache-2.0
"""Describes the actions, expectations and knowledge of the agents in words and numbers for users."""
