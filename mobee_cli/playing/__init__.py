# SPDX-License-Identifier: Apache-2.0
"""Code that `mobee play` and `mobee learn` share: the setup (a robot with its agents), the files of a setup, and offline learning."""
