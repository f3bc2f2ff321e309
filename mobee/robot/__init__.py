# SPDX-License-Identifier: Apache-2.0
"""What a robot is, and the files that describe robots and worlds."""
