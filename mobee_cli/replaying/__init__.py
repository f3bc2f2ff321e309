# SPDX-License-Identifier: Apache-2.0
"""Plays a recording again on the page or into a service in lockstep, and compares it with another recording."""
