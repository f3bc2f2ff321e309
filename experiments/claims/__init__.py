# SPDX-License-Identifier: Apache-2.0
"""The claims of the thesis and the paper, one module each, by chapter of the thesis."""
