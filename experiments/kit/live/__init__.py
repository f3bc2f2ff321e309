# SPDX-License-Identifier: Apache-2.0
"""Code that is shared by the experiments that run the live system."""
