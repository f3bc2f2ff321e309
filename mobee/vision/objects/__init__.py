# SPDX-License-Identifier: Apache-2.0
"""Objects that two cameras see: detectors, positions with size and covariance, tracks with permanent names, and camera failures."""
