# SPDX-License-Identifier: Apache-2.0
"""Raw records: the values of every seed of a run, with settings and commit, in one archive per experiment.

The archives are part of the repository.  Anybody can compute all verdicts, intervals and figures from them again, without a new run.  The
files of an experiment are similar to each other, so they are compressed together: the archive has less than half the size of a .zip.
"""

from __future__ import annotations

import io
import lzma
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from experiments.kit.run_folder import CONFIG, VERSIONS
from mobee.errors import InvalidValue

RECORDS = Path(__file__).parent.parent / "records"
MAX_BYTES, MAX_ALL = 2_000_000, 10_000_000  # of one archive, and of all together
_SUFFIX = ".tar.xz"
_BITS = ((3, 0, 2), (3, 0, 0), (0, 2, 2), (0, 3, 3))  # lc, lp, pb of LZMA: for text, for bytes, and for numbers of 4 and of 8 bytes
_NO_TIME = (1980, 1, 1, 0, 0, 0)  # the same files give the same archive


class TooLarge(InvalidValue):
    """Raised if the archive of a run is too large for the repository: more than MAX_BYTES (2 MB)."""


def record_path(name: str, confirms: bool = False) -> Path:
    """Return the path of the archive with the recorded values of an experiment.

    `confirms`: False: the archive of the first run; True: that of the later run with new seeds, which confirms the first run.
    """
    return RECORDS / f"{name}{'-confirm' if confirms else ''}{_SUFFIX}"


def all_records() -> list[Path]:
    """Return the paths of the archives of all experiments, sorted."""
    return sorted(RECORDS.glob(f"*{_SUFFIX}"))


def keep_record(name: str, run: Path, versions: Path, kept: Sequence[str], confirms: bool = False, folder: Path | None = None) -> Path:
    """Write the archive of a finished run and return its path; an interruption leaves no incomplete archive.

    Args:
        name: name of the experiment.
        run: folder of the run, with config.json.
        versions: path of the versions.json of the run.
        kept: glob patterns of the files in `folder` that are recorded.
        confirms: whether the run has new seeds and confirms an earlier one; its archive cannot be replaced by that of another run.
        folder: folder with the files `kept`; None: `run`.

    Raises:
        InvalidValue: no file matches, or another run has confirmed the experiment already.
        TooLarge: the archive would be larger than MAX_BYTES (2 MB).
    """
    place = run if folder is None else folder
    files = sorted({path for pattern in kept for path in place.glob(pattern)})
    if not files:
        raise InvalidValue(f"{run} has none of the files {', '.join(kept) or '(the experiment names none)'}: there is nothing to record.")
    members = {member: source.read_bytes() for member, source in ((CONFIG, run / CONFIG), (VERSIONS, versions))}
    members |= {str(file.relative_to(place)): _unpacked(file) if file.suffix == ".npz" else file.read_bytes() for file in files}
    archive = _archive(members)
    if len(archive) > MAX_BYTES:
        raise TooLarge(
            f"the record of {name} has {len(archive) / 1e6:.1f} MB, at most {MAX_BYTES / 1e6:.0f} MB fit: give its sweep a summary."
        )
    path = record_path(name, confirms)
    if confirms and path.exists() and _members(path) != members:
        raise InvalidValue(f"{path} exists: an experiment is confirmed once, with the first run of new seeds. {run} is another run.")
    path.parent.mkdir(exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    unfinished.write_bytes(archive)
    unfinished.replace(path)
    return path


def _archive(members: Mapping[str, bytes]) -> bytes:
    """Return an archive with these files, given as contents by name."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w") as archive:
        for name, data in members.items():
            about = tarfile.TarInfo(name)  # without a time or an owner: the same files give the same archive
            about.size = len(data)
            archive.addfile(about, io.BytesIO(data))
    return min((_compressed(content.getvalue(), *bits) for bits in _BITS), key=len)


def _compressed(data: bytes, lc: int, lp: int, pb: int) -> bytes:
    settings = {"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "lc": lc, "lp": lp, "pb": pb}
    return lzma.compress(data, filters=[settings])


def _members(path: Path) -> dict[str, bytes]:
    """Return the contents of the files in an archive, by name; raises InvalidValue if it is damaged."""
    try:
        with tarfile.open(path, "r:xz") as archive:
            return {about.name: file.read() for about in archive if (file := archive.extractfile(about)) is not None}
    except (tarfile.TarError, lzma.LZMAError, EOFError, OSError) as error:
        raise InvalidValue(f"{path} is damaged ({error}): restore it with git, or write it anew.") from None


def _unpacked(path: Path) -> bytes:
    """Return the content of the .npz file `path`, packed anew without compression, as bytes.

    The archive of the run compresses uncompressed arrays better.  The files inside have no time, so equal arrays give equal bytes.
    """
    content = io.BytesIO()
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(content, "w") as unpacked:
        for name in source.namelist():
            unpacked.writestr(zipfile.ZipInfo(name, _NO_TIME), source.read(name))
    return content.getvalue()


@contextmanager
def opened_record(name: str, confirms: bool = False) -> Iterator[Path]:
    """Extract the archive of an experiment into a temporary folder, and yield this folder, which has the files of the run's folder.

    A context manager: the folder is removed at the end.  `confirms`: False: the archive of the first run; True: that of the later run with
    new seeds, which confirms the first run.  Raises InvalidValue if there is no archive, or if it is damaged.
    """
    path = record_path(name, confirms)
    if not path.exists():
        raise InvalidValue(f"there is no record of {name!r} in {path.parent}: run the experiment, then `mobee experiment claims --write`.")
    members = _members(path)
    with tempfile.TemporaryDirectory(prefix="mobee-record-") as name_of_folder:
        folder = Path(name_of_folder)
        for member, data in members.items():
            file = folder / member
            if not file.resolve().is_relative_to(folder.resolve()):
                raise InvalidValue(f"{path} is damaged (a file is named {member}): restore it with git, or write it anew.")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        yield folder
