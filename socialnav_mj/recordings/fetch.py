"""Download recordings of the catalogue from their public source, checked by sha256."""

from collections.abc import Callable
from pathlib import Path

import pooch
from pooch.downloaders import HTTPDownloader
from pooch.hashes import hash_matches

from socialnav_mj.files import written_whole
from socialnav_mj.recordings.catalogue import UNKNOWN, CatalogueRow, catalogue, catalogue_row

Progress = Callable[[str, int, int], None]
"""Called with file name, bytes so far and bytes in total (0: the server does not say)."""
TIMEOUT = 30.0
"""Longest silence of the server [s]."""


class FetchError(RuntimeError):
    """A download failed; the message says of what, from where and why."""


def fetch(
    name: str, *, data_dir: str | Path | None = None, progress: Progress | None = None, accept_unverified: bool = False
) -> tuple[Path, ...]:
    """Download all files of a recording; those that are there and right are kept.

    Args:
        name: As it stands in the catalogue.
        data_dir: Where to; None is the user's cache, where `load_recording` looks without being told.
        progress: Called after every chunk that arrives.
        accept_unverified: Take files as they come of which the catalogue knows no sha256.

    Returns:
        Paths of all files of all variants, in the order of the catalogue.

    Raises:
        ValueError: If the name is unknown or the recording is embedded.
        FetchError: If a download fails or is not what the catalogue expects, which leaves nothing behind, or if the
            catalogue knows no sha256 of a file and that is not accepted.
    """
    row = catalogue_row(name)
    if row.url is None:
        others = ", ".join(other.name for other in catalogue().values() if other.url)
        raise ValueError(f"recording {name!r} is embedded, there is nothing to fetch; can be fetched: {others}")
    root = Path(pooch.os_cache("socialnav-mj")) if data_dir is None else Path(data_dir).expanduser()
    unknown = sorted({file for files in row.variants.values() for file, digest in files.items() if digest == UNKNOWN})
    if unknown and not accept_unverified:
        raise FetchError(
            f"the catalogue knows no sha256 of {' and '.join(unknown)} of recording {name!r}, so that nobody can tell "
            "whether a download is what it should be; --accept-unverified downloads it all the same"
        )
    return fetch_row(row, root, progress=progress)


def fetch_row(row: CatalogueRow, root: Path, *, progress: Progress | None = None) -> tuple[Path, ...]:
    """Download all files of a catalogue row.

    Args:
        row: Of a recording that has a url.
        root: Data directory; the files go into `root / row.folder`.
        progress: Called after every chunk that arrives.

    Returns:
        Paths of all files, in the order of the row's variants.

    Raises:
        FetchError: If a download fails or has another sha256 than the row; the failed file leaves nothing behind.
    """
    expected = {name: digest for files in row.variants.values() for name, digest in files.items()}
    folder = root / row.folder
    paths = []
    for name, digest in expected.items():
        path, url = folder / name, row.address(name)
        known = None if digest == UNKNOWN else f"sha256:{digest}"
        bar = None if progress is None else _Bar(name, progress)
        downloader = HTTPDownloader(progressbar=bar, timeout=TIMEOUT)
        try:
            if not (path.is_file() and (known is None or hash_matches(str(path), known))):
                # Not pooch.retrieve: what a kill leaves of its temporary files nobody would know as such.
                with written_whole(path) as part:
                    downloader(url, str(part), None)
                    if known is not None:
                        hash_matches(str(part), known, strict=True, source=name)
        except (OSError, ValueError) as error:
            # requests' errors are OSErrors; pooch reports a wrong checksum, with both sums, as ValueError.
            raise FetchError(f"could not fetch {path} of recording {row.name!r} from {url}: {error}") from error
        paths.append(path)
    return tuple(paths)


class _Bar:
    """What pooch expects of a progress bar."""

    def __init__(self, name: str, progress: Progress) -> None:
        self.total = 0
        self._name, self._progress, self._done = name, progress, 0

    def update(self, n: int) -> None:
        # pooch adds whole chunks, and at the end resets and adds the total.
        self._done += n
        self._progress(self._name, min(self._done, self.total) if self.total else self._done, self.total)

    def reset(self) -> None:
        self._done = 0

    def close(self) -> None:
        pass
