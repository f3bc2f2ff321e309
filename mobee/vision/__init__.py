# SPDX-License-Identifier: Apache-2.0
"""Vision: lenses, cameras with imperfections, the places of what two of them see, and their calibration by looking at the own hand."""
