"""Public recordings, brought from where they are published and compared with the checksums we know.

What there is stands in `assets/clips.csv`: file, sha256, size, address. An address names the repository, the
commit and the path, so that it cannot change. A mirror is a folder or a URL with the same files.
"""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from ..sims.errors import InputError

TIMEOUT = 30.0
"""[s] without an answer after which a download is given up."""


@dataclass(frozen=True)
class DataSet:
    """A published set of clips: what one has to know to use it."""

    title: str
    home: str
    licence: str
    citation: str


CMU = DataSet(
    title="CMU Graphics Lab Motion Capture Database, subjects 02, 06, 07, 08, 09, as BVH",
    home=(
        "mocap.cs.cmu.edu (original ASF/AMC); BVH conversion by Bruce Hahne, cgspeed.com, 2010; these files "
        "come from an unchanged public copy of it, github.com/chrystianosaraujo/motion-viewer"
    ),
    licence=(
        '"This data is free for use in research projects. You may include this data in commercially-sold '
        'products, but you may not resell this data directly, even in converted form."'
    ),
    citation=(
        "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with "
        "funding from NSF EIA-0196217."
    ),
)
BALLPLAY = DataSet(
    title="BallPlay-M, the released part: basketball with a recorded ball",
    home="github.com/wyhuai/SkillMimic",
    licence='Apache License 2.0, "Copyright [2024] [Yinhuai Wang]"',
    citation=(
        "Wang, Y., Zhao, Q., Yu, R., et al. SkillMimic: Learning Reusable Basketball Skills from "
        "Demonstrations. arXiv:2408.15270, 2024."
    ),
)
SETS = {"cmu": CMU, "ballplay": BALLPLAY}
FOLDERS = {"cmu": "cmu", "ballplay": "ballplay_m"}


class FetchError(InputError):
    """A file that could not be brought; the message is one line with the file and the reason."""


@dataclass(frozen=True)
class Entry:
    """A file of a set."""

    file: str
    """'cmu/06_12.bvh', also below the data folder."""
    sha256: str
    size: int
    """[bytes]"""
    url: str
    """Empty where no public address is known."""


def data_folder() -> Path:
    """Where recordings lie: $WARPDRIBBLE_DATA, else a folder in the user's cache."""
    import pooch

    return Path(os.environ.get("WARPDRIBBLE_DATA") or pooch.os_cache("warpdribble"))


def set_of(clip: str | Path) -> str:
    """The name of the set that a clip of the data folder, as 'cmu/06_12.bvh', is of; "" for none."""
    folder = Path(clip).parts[0] if Path(clip).parts else ""
    return next((name for name, own in FOLDERS.items() if own == folder), "")


def entries(name: str) -> list[Entry]:
    """The files of a set. Raises ValueError for a set that is none."""
    if name not in SETS:
        raise ValueError(f"there is no data set '{name}'; there are {', '.join(SETS)}")
    text = (resources.files("warpdribble.assets") / "clips.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    all_files = [Entry(r["file"], r["sha256"], int(r["bytes"]), r["url"]) for r in rows]
    return [entry for entry in all_files if entry.file.startswith(FOLDERS[name] + "/")]


def fetch(
    name: str,
    folder: Path | None = None,
    mirror: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[list[Path], list[str]]:
    """Bring a set below `folder`; the files that are there now, and those without a public address.

    A file that is there and whole is not brought again; a file appears whole or not at all. mirror: a folder
    or URL that has the files, as `cmu/06_12.bvh` or `06_12.bvh`. Raises FetchError.
    """
    folder = Path(folder) if folder is not None else data_folder()
    if mirror is not None and "://" not in mirror and not Path(mirror).is_dir():
        raise FetchError("no such folder", mirror, "mirror")
    brought, unknown = [], []
    for done, entry in enumerate(entries(name)):
        target = folder / entry.file
        source = _source(entry, mirror)
        if source is None and not target.exists():
            unknown.append(entry.file)
            continue
        brought.append(_bring(entry, target, source))
        if progress:
            progress(done + 1)
    return brought, unknown


def _source(entry: Entry, mirror: str | None) -> str | None:
    if mirror is None:
        return entry.url or None
    if "://" in mirror:
        return f"{mirror.rstrip('/')}/{entry.file}"
    for path in (Path(mirror) / entry.file, Path(mirror) / Path(entry.file).name):
        if path.is_file():
            return str(path)
    raise FetchError(f"has no {entry.file}", mirror, "mirror")


def _bring(entry: Entry, target: Path, source: str | None) -> Path:
    """Download or copy one file, compare its checksum, and move it to its place."""
    import pooch

    pooch.get_logger().setLevel("ERROR")
    remote = source is not None and "://" in source
    how = pooch.HTTPDownloader(timeout=TIMEOUT) if remote else _copy
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        pooch.retrieve(
            url=source or str(target),
            known_hash=f"sha256:{entry.sha256}",
            fname=target.name,
            path=target.parent,
            downloader=how,
        )
    except ValueError as error:
        if "hash" not in str(error):
            raise FetchError(str(error), entry.file) from None
        raise FetchError(f"{source} is another file (its sha256 differs)", entry.file) from None
    except OSError as error:
        reason = error.strerror or f"{source} could not be reached ({type(error).__name__})"
        raise FetchError(reason, entry.file, "files") from None
    return target


def _copy(url: str, output_file: str, pooch: object) -> None:
    """A pooch downloader for files of this machine."""
    shutil.copyfile(url, output_file)
