# SPDX-License-Identifier: Apache-2.0
"""The experiments that test published claims: each module of `claims` states claims, sources and published numbers, and runs the test."""
