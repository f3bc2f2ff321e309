from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mobee.engine import cache

SOURCES = Path(cache.__file__).parents[1]


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the library, whose key is then asked for."""
    folder = tmp_path / "mobee"
    shutil.copytree(SOURCES, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(cache, "_SOURCES", folder)
    return folder


def test_the_key_is_that_of_the_content_not_of_place_or_time(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copied = cache.key()
    monkeypatch.setattr(cache, "_SOURCES", SOURCES)
    assert cache.key() == copied


def test_an_edit_of_any_source_changes_the_key(copy: Path) -> None:
    keys, sources = {cache.key()}, cache.compiled_sources()
    assert all(source.is_relative_to(copy) for source in sources)
    for source in sources:
        text = source.read_bytes()
        source.write_bytes(text + b"#")
        keys.add(cache.key())
        source.write_bytes(text)
    assert len(sources) > 40
    assert len(keys) == len(sources) + 1


def test_a_new_file_and_a_new_name_change_the_key(copy: Path) -> None:
    before = cache.key()
    (copy / "engine" / "new.py").touch()
    added = cache.key()
    (copy / "engine" / "new.py").rename(copy / "engine" / "newer.py")
    assert len({before, added, cache.key()}) == 3


def test_a_functions_file_depends_on_what_its_source_imports_and_on_nothing_else(copy: Path) -> None:
    def stamps() -> dict[str, str]:
        cache.stamp.cache_clear()
        cache._imported.cache_clear()
        return {name: cache.stamp(str(copy / "engine" / f"{name}.py")) for name in ("sieve", "neighbours", "narrow/gjk")}

    before = stamps()
    (copy / "engine" / "sieve.py").open("a").write("#")
    after = stamps()
    assert [name for name in before if before[name] != after[name]] == ["sieve", "neighbours"]


@pytest.mark.parametrize("package", ["numba", "llvmlite", "numpy"])
def test_another_version_of_what_compiles_changes_the_key(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before, real = cache.key(), cache.version
    monkeypatch.setattr(cache, "version", lambda name: "999" if name == package else real(name))
    assert cache.key() != before


def test_another_processor_changes_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    before = cache.key()
    monkeypatch.setattr(cache, "_processor", lambda: "another")
    assert cache.key() != before


def test_settings_of_numba_change_the_key_where_they_change_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    before = cache.key()
    monkeypatch.setenv("NUMBA_NUM_THREADS", "7")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/nowhere")
    assert cache.key() == before
    monkeypatch.setenv("NUMBA_OPT", "0")
    assert cache.key() != before


def test_the_folder_is_where_the_environment_says(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("MOBEE_CACHE", raising=False)
    assert cache.cache_folder().parent == Path.home() / ".cache" / "mobee"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_folder().parent == tmp_path / "mobee"
    monkeypatch.setenv("MOBEE_CACHE", str(tmp_path / "mine"))
    assert cache.cache_folder().parent == tmp_path / "mine"


def test_the_file_alone_prints_the_folder_without_numba() -> None:
    """As scripts/environment.sh asks for it at every start."""
    argv = [sys.executable, "-I", "-X", "importtime", str(SOURCES / "engine" / "cache.py")]
    done = subprocess.run(argv, capture_output=True, text=True, check=True)
    assert done.stdout == f"{cache.cache_folder()}\n"
    assert not {"numba", "numpy", "llvmlite", "mobee"} & {line.split("|")[-1].strip() for line in done.stderr.splitlines()}


def test_folders_used_last_are_kept_and_nothing_else_is_removed(tmp_path: Path) -> None:
    old = [tmp_path / f"engine-{index:016x}" for index in range(cache.KEPT + 3)]
    for age, folder in enumerate(old):
        folder.mkdir()
        (folder / cache.READY).touch()
        os.utime(folder / cache.READY, (1e9 - age, 1e9 - age))
    others = [tmp_path / name for name in ("engine", "engine-0", "engine-notes", "engine-0123456789abcdeg", "runs")]
    for folder in others:
        folder.mkdir()
    (tmp_path / "outside").mkdir()
    link = tmp_path / f"engine-{99:016x}"
    link.symlink_to(tmp_path / "outside")
    cache.mark_used(old[-1])
    new = tmp_path / f"engine-{77:016x}"
    new.mkdir()
    cache.mark_ready(new)
    assert cache.is_ready(new)
    assert [folder for folder in old if folder.exists()] == [*old[: cache.KEPT - 1], old[-1]]
    assert all(folder.exists() for folder in (*others, link, tmp_path / "outside"))
