# SPDX-License-Identifier: Apache-2.0
"""A detector that is learned from rendered pictures: labelled pictures, training, and the network with its file."""
