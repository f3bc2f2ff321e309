# SPDX-License-Identifier: Apache-2.0
"""The contract between the processes: key expressions, messages, codec, version."""

from bus_schema.codec import UNDECODABLE, Refused, decode, encode, encoding_of, type_of
from bus_schema.version import VERSION

__all__ = ["UNDECODABLE", "VERSION", "Refused", "decode", "encode", "encoding_of", "type_of"]
