# SPDX-License-Identifier: Apache-2.0
"""One robot teaches another to see: it carries a ball to places that it knows, and the other learns places from pictures and encoders."""
