from __future__ import annotations

import pytest

from services.launcher.engine import compile_engine


@pytest.fixture(scope="session", autouse=True)
def compiled_engine() -> None:
    """No service under test compiles for half a minute and is taken for dead."""
    compile_engine()
