# SPDX-License-Identifier: Apache-2.0
"""Writes the shipped robot files from numbers."""
