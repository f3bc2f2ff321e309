# SPDX-License-Identifier: Apache-2.0
"""The processes of the system; each decodes a message, calls the library and encodes the answer."""
