# SPDX-License-Identifier: Apache-2.0
"""Plays a recording again: on the page, into a service in lockstep, and beside another recording."""
