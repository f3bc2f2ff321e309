# SPDX-License-Identifier: Apache-2.0
"""Raw records: the values of every seed of a run, with settings and commit, in one archive per experiment.

The archives are part of the repository.  Anybody can compute all verdicts, intervals and figures from them again, without a new run.
"""

from __future__ import annotations

import io
import lzma
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from experiments.kit.run_folder import CONFIG, VERSIONS
from mobee.errors import InvalidValue

RECORDS = Path(__file__).parent.parent / "records"
MAX_BYTES, MAX_ALL = 2_000_000, 10_000_000  # of one archive, and of all together
_NO_TIME = (1980, 1, 1, 0, 0, 0)  # the same files give the same archive


class TooLarge(InvalidValue):
    """Raised for a record that is too large for the repository."""


def record_path(name: str, confirms: bool = False) -> Path:
    """Return the archive of an experiment, or with `confirms` of its run with new seeds."""
    return RECORDS / f"{name}{'-confirm' if confirms else ''}.zip"


def all_records() -> list[Path]:
    """Return all archives, sorted."""
    return sorted(RECORDS.glob("*.zip"))


def keep_record(name: str, run: Path, versions: Path, kept: Sequence[str], confirms: bool = False, folder: Path | None = None) -> Path:
    """Write the archive of a finished run, whole or not at all.

    Args:
        name: of the experiment.
        run: folder of the run, with config.json.
        versions: the versions.json of the run.
        kept: glob patterns of files in `folder`.
        confirms: whether the run confirms the first one with new seeds; its archive is written once.
        folder: with the kept files; None: that of the run.

    Raises:
        InvalidValue: no file matches, or another run has confirmed the experiment.
        TooLarge: the archive would be larger than MAX_BYTES.
    """
    place = run if folder is None else folder
    files = sorted({path for pattern in kept for path in place.glob(pattern)})
    if not files:
        raise InvalidValue(f"{run} has none of the files {', '.join(kept) or '(the experiment names none)'}: there is nothing to record.")
    path = record_path(name, confirms)
    unfinished = path.with_suffix(".unfinished")
    path.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(unfinished, "w") as archive:
        for member, source in [(CONFIG, run / CONFIG), (VERSIONS, versions), *((str(file.relative_to(place)), file) for file in files)]:
            content = _unpacked(source) if source.suffix == ".npz" else source.read_bytes()
            archive.writestr(zipfile.ZipInfo(member, _NO_TIME), content, zipfile.ZIP_LZMA)
    if (size := unfinished.stat().st_size) > MAX_BYTES:
        unfinished.unlink()
        raise TooLarge(f"the record of {name} has {size / 1e6:.1f} MB, at most {MAX_BYTES / 1e6:.0f} MB fit: give its sweep a summary.")
    if confirms and path.exists() and path.read_bytes() != unfinished.read_bytes():
        unfinished.unlink()
        raise InvalidValue(f"{path} exists: an experiment is confirmed once, with the first run of new seeds. {run} is another run.")
    unfinished.replace(path)
    return path


def _unpacked(path: Path) -> bytes:
    """Return a .npz file whose arrays are not compressed: the archive compresses them better."""
    content = io.BytesIO()
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(content, "w") as unpacked:
        for name in source.namelist():
            unpacked.writestr(zipfile.ZipInfo(name, _NO_TIME), source.read(name))
    return content.getvalue()


@contextmanager
def opened_record(name: str, confirms: bool = False) -> Iterator[Path]:
    """Extract the archive of an experiment; yields a folder like that of its run, and removes it afterwards.

    Raises InvalidValue if there is none, or if it is damaged.
    """
    path = record_path(name, confirms)
    if not path.exists():
        raise InvalidValue(f"there is no record of {name!r} in {path.parent}: run the experiment, then `mobee experiment claims --write`.")
    with tempfile.TemporaryDirectory(prefix="mobee-record-") as folder:
        try:
            with zipfile.ZipFile(path) as archive:
                archive.extractall(folder)
        except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, OSError) as error:
            raise InvalidValue(f"{path} is damaged ({error}): restore it with git, or write it anew.") from None
        yield Path(folder)
