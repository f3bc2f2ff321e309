# SPDX-License-Identifier: Apache-2.0
"""Thesis chapter 7, paper section 3: learning a model of the actions by curiosity."""
