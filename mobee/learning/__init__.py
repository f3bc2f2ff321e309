# SPDX-License-Identifier: Apache-2.0
"""Learning by curiosity: the state-action space, the transition model, plans, and the curious agent (thesis chapters 6 and 7)."""
