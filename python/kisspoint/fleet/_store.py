"""Folders and files of a store: a local disk, S3 or any other that fsspec opens."""

import os
import secrets
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import fsspec
from fsspec.implementations.local import LocalFileSystem

MAGIC = "*?["


@dataclass(frozen=True)
class Place:
    """A folder or file of a store."""

    fs: Any
    path: str

    @classmethod
    def of(cls, url: str | Path, options: Mapping[str, Any] | None = None) -> "Place":
        """The place that a path or a URL names."""
        fs, path = fsspec.core.url_to_fs(str(url), **dict(options or {}))
        return cls(fs, str(path))

    @property
    def local(self) -> bool:
        """Whether it lies on this machine's disks."""
        return isinstance(self.fs, LocalFileSystem)

    def __truediv__(self, name: str) -> "Place":
        return Place(self.fs, f"{self.path.rstrip('/')}/{name}")

    @property
    def url(self) -> str:
        """Path or URL as a user would write it."""
        return self.path if self.local else str(self.fs.unstrip_protocol(self.path))

    def read(self) -> bytes | None:
        """Content of the file; None if it does not exist."""
        try:
            return bytes(self.fs.cat_file(self.path))
        except FileNotFoundError:
            return None

    def write(self, content: bytes) -> None:
        """Replaces the file atomically: a reader finds either the old or the new content, whatever happens during writing."""
        if not self.local:
            self.fs.pipe_file(self.path, content)
            return
        path = Path(self.path)
        path.parent.mkdir(parents=True, exist_ok=True)
        beside = path.parent / f".kisspoint-{secrets.token_hex(8)}.partial"
        try:
            with open(beside, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)

    def write_file(self, source: Path) -> None:
        """Replaces the file atomically by a local file."""
        if not self.local:
            self.fs.put_file(str(source), self.path)
            return
        path = Path(self.path)
        path.parent.mkdir(parents=True, exist_ok=True)
        beside = path.parent / f".kisspoint-{secrets.token_hex(8)}.partial"
        try:
            shutil.copyfile(source, beside)
            os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)


@dataclass(frozen=True)
class Campaign:
    """A campaign of a fleet."""

    url: str
    """Path or URL."""
    name: str
    """Name in the answer: the last part of the path, made unique if another campaign has the same."""


def campaigns(asked: str | Path | Iterable[str | Path], options: Mapping[str, Any] | None = None) -> Iterator[Campaign]:
    """Campaigns of paths, URLs and patterns, one after the other. A folder that is no campaign but contains some stands for these.

    Patterns match only folders. If two campaigns have the same name, a digest of the path is added to the name of the later one.
    """
    seen: set[bytes] = set()
    for url in _folders([asked] if isinstance(asked, str | Path) else asked, options):
        name = url.rstrip("/").rsplit("/", 1)[-1]
        short = sha256(name.encode()).digest()[:8]
        if short in seen:
            name = f"{name}-{sha256(url.encode()).hexdigest()[:8]}"
            short = sha256(name.encode()).digest()[:8]
        seen.add(short)
        yield Campaign(url, name)


def _folders(asked: Iterable[str | Path], options: Mapping[str, Any] | None) -> Iterator[str]:
    for one in asked:
        place = Place.of(one, options)
        if any(c in str(one) for c in MAGIC):
            found = place.fs.glob(place.path, detail=True)
            folders = sorted(path for path, about in found.items() if about["type"] == "directory" and not _hidden(path))
            # A pattern that matches nothing becomes a row with that error.
            yield from (Place(place.fs, path).url for path in folders) if folders else [place.url]
            continue
        inside = [] if place.fs.exists((place / "vehicle.json").path) else _campaigns_in(place)
        yield from inside or [place.url]


def _campaigns_in(place: Place) -> list[str]:
    return sorted(Place(place.fs, path.rsplit("/", 1)[0]).url for path in place.fs.glob(f"{place.path.rstrip('/')}/*/vehicle.json"))


def _hidden(path: str) -> bool:
    return path.rstrip("/").rsplit("/", 1)[-1].startswith(".")


def fetch(place: Place, into: Path) -> None:
    """Copies a campaign's files, except for hidden ones."""
    root = place.path.rstrip("/")
    if not place.fs.exists(root):
        raise FileNotFoundError(f"{place.url}: there is no such folder; check the path")
    if place.fs.isfile(root):
        raise NotADirectoryError(f"{place.url}: is a file; a campaign is a folder with vehicle.json, recordings.json and recordings")
    into.mkdir(parents=True)
    inside = {str(path): str(path)[len(root) :].lstrip("/") for path in place.fs.find(root)}
    wanted = {path: into / name for path, name in inside.items() if not any(part.startswith(".") for part in name.split("/"))}
    for target in wanted.values():
        target.parent.mkdir(parents=True, exist_ok=True)
    if wanted:
        # Files of a remote store are fetched in parallel.
        place.fs.get(list(wanted), [str(target) for target in wanted.values()])
