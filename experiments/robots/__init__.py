# SPDX-License-Identifier: Apache-2.0
"""Programs that write the files of the shipped iCub models, and the list of link pairs that count as solid contact."""
