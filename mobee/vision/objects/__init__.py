# SPDX-License-Identifier: Apache-2.0
"""Objects that two cameras see: detectors, places with size and covariance, tracks with stable names, and cameras that fail."""
