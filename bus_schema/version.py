# SPDX-License-Identifier: Apache-2.0
"""The version of the contract; a receiver refuses messages of every other version."""

VERSION = 8
