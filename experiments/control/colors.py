"""How the gain sets are drawn, alike in all figures."""

from __future__ import annotations

COLORS = {"default": "tab:blue", "published_2014": "tab:orange"}
