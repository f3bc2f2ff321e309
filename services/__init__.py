# SPDX-License-Identifier: Apache-2.0
"""The processes of the system (services). Each service decodes messages, calls the library `mobee` and encodes the results."""
