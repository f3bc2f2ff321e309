# SPDX-License-Identifier: Apache-2.0
"""One readable file a claim: the claim, its source, the published number, the run that tests it."""
