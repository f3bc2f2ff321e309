from __future__ import annotations

import subprocess
import sys

import mobee

FOREIGN = ("zenoh", "rerun", "pybullet", "cv2", "bus_schema", "services")


def test_every_public_name_exists_once_and_in_order():
    assert all(hasattr(mobee, name) for name in mobee.__all__)
    assert mobee.__all__ == sorted(set(mobee.__all__), key=lambda name: (name[0].islower(), name))


def test_importing_the_library_brings_no_bus_viewer_or_simulator():
    script = f"import sys, mobee; print([name for name in {FOREIGN!r} if name in sys.modules])"
    seen = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert seen.stdout.strip() == "[]"


def test_importing_the_library_loads_no_compiled_code():
    script = "import sys, mobee; print([name for name in ('numba', 'mobee.engine.evaluate', 'scipy') if name in sys.modules])"
    seen = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert seen.stdout.strip() == "[]"
