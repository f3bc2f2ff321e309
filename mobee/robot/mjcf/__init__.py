# SPDX-License-Identifier: Apache-2.0
"""MJCF robots: MuJoCo compiles the file; this package turns the compiled model into a Robot."""
