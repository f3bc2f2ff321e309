from __future__ import annotations

from tests.services.conftest import compiled_engine

__all__ = ["compiled_engine"]
