# SPDX-License-Identifier: Apache-2.0
"""Shared by experiments about learning the outcomes of actions."""
