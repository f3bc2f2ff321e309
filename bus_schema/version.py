# SPDX-License-Identifier: Apache-2.0
"""The version of the contract (all messages, calls and keys of the bus); a receiver refuses messages of every other version."""

VERSION = 8
