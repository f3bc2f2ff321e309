# SPDX-License-Identifier: Apache-2.0
"""One robot teaches another to see: it carries a ball to known positions; the other learns positions from pictures and encoders."""
