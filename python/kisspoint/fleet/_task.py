"""One campaign of a fleet: fetched, looked up in the cache, diagnosed, stored. Errors are not raised but recorded in its row."""

import functools
import io
import json
import os
import signal
import subprocess
import tempfile
import threading
import time
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from .. import _command
from ._store import Campaign, Place, fetch
from ._table import Row, of_diagnosis

ABOUT = "car.json"
"""Optional file of a campaign that states the car, its mileage and the date; it does not influence the diagnosis."""

LAYOUT = "1"
"""Version of the cache's content; entries of another version are computed again."""

_WAIT_S = 0.5
"""Delay before the first retry, s; doubled with each further one."""


@dataclass(frozen=True)
class Settings:
    """Settings that all tasks of a run share; small, because they are sent along with every task."""

    out: str | None = None
    """Folder for the answers, with a subfolder for each campaign; None keeps only the rows."""
    cache: str | None = None
    """Folder of the cache; None disables it."""
    channel_map: bytes | None = None
    """Content of a channel map."""
    map_ending: str = ".toml"
    """File extension that states its format."""
    strict: bool = False
    """Refuse a campaign in which any recording has a defect."""
    fmu: bool = False
    """Also write the retuned FMU."""
    retries: int = 2
    """Number of retries after a failure that may be temporary: a store that does not answer, a command that was killed."""
    timeout_s: float = 3600.0
    """Longest time of one diagnosis, s."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options with which fsspec opens the stores."""


class Children:
    """Commands that run in this process's threads, so that a cancelled run can end them."""

    def __init__(self) -> None:
        self._running: set[subprocess.Popen[bytes]] = set()
        self._lock = threading.Lock()
        self.stopped = threading.Event()

    def run(self, words: list[str], timeout_s: float) -> tuple[int, str]:
        """Runs a command. Returns its exit code and its output on standard error."""
        with self._lock:
            if self.stopped.is_set():
                raise InterruptedError("cancelled")
            # In a process group of its own: Ctrl-C is handled by this process, and the command's own child processes are terminated with it.
            group = 0 if os.name == "posix" else None
            child = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, process_group=group)
            self._running.add(child)
        try:
            _, said = child.communicate(timeout=timeout_s)
            return child.returncode, said.decode("utf-8", "replace")
        finally:
            _end(child)
            child.wait()
            with self._lock:
                self._running.discard(child)

    def stop(self) -> None:
        """Terminates all commands; none can begin afterwards."""
        self.stopped.set()
        with self._lock:
            for child in self._running:
                _end(child)


def _end(child: "subprocess.Popen[bytes]") -> None:
    if child.poll() is not None:
        return
    if os.name == "posix":
        os.killpg(child.pid, signal.SIGKILL)
    else:
        child.kill()


class Passing(RuntimeError):
    """A failure that may be temporary."""


@functools.cache
def version(command: str, _written: tuple[int, int]) -> tuple[str, str]:
    """Version of the command, and the SHA-256 of its file."""
    said = subprocess.run([command, "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]
    return said, sha256(Path(command).read_bytes()).hexdigest()


def installed() -> tuple[str, str, str]:
    """The command on this machine, its version and its SHA-256."""
    command = _command.path()
    about = command.stat()
    return str(command), *version(str(command), (about.st_mtime_ns, about.st_size))


def run(campaign: Campaign, settings: Settings, children: Children | None = None) -> Row:
    """Diagnoses one campaign. Returns its row, which has `error` in place of an answer if there is none."""
    began = time.monotonic()
    row: Row = {"campaign": campaign.url, "name": campaign.name, "cached": False, "attempts": 0}
    for attempt in range(settings.retries + 1):
        row["attempts"] = attempt + 1
        try:
            row |= _once(campaign, settings, children or Children())
            row["error"] = None
            break
        except InterruptedError:
            row["error"] = "cancelled"
            break
        except (_command.KisspointError, FileNotFoundError, NotADirectoryError, PermissionError) as error:
            row["error"] = str(error)
            break
        except Exception as error:  # noqa: BLE001 whatever it is, the other campaigns go on
            row["error"] = f"{type(error).__name__}: {error}" if not isinstance(error, Passing) else str(error)
            if attempt < settings.retries:
                time.sleep(_WAIT_S * 2**attempt)
    row["seconds"] = time.monotonic() - began
    return row


def _once(campaign: Campaign, settings: Settings, children: Children) -> Row:
    command, said, binary = installed()
    row: Row = {"version": said, "binary": binary}
    with tempfile.TemporaryDirectory(prefix="kisspoint-fleet-") as work:
        # The title of the report is the campaign's own name.
        folder = Path(work) / "campaign" / (campaign.url.rstrip("/").rsplit("/", 1)[-1] or "campaign")
        fetch(Place.of(campaign.url, settings.options), folder)
        row |= _about(folder / ABOUT, campaign)
        row["key"] = key = _key(folder, settings, said, binary)
        entry = Place.of(settings.cache, settings.options) / key[:2] / f"{key}.zip" if settings.cache else None
        files = _unpacked(entry.read()) if entry else None
        row["cached"] = files is not None
        if files is None:
            began = time.monotonic()
            files = _diagnosed(command, folder, Path(work) / "answer", campaign, settings, children)
            row["command_s"] = time.monotonic() - began
            if entry:
                entry.write(_packed(files))
    row |= of_diagnosis(json.loads(files["diagnosis.json"]), files["vehicle.json"].decode("utf-8-sig"))
    if settings.out:
        row |= _published(files, key, Place.of(settings.out, settings.options) / campaign.name)
    return row


def _key(folder: Path, settings: Settings, said: str, binary: str) -> str:
    """Digest of everything that determines the answer: names and content of the files, the settings, the command."""
    digest = sha256()

    def add(*parts: bytes) -> None:
        for part in parts:
            digest.update(len(part).to_bytes(8, "big"))
            digest.update(part)

    switches = json.dumps([settings.strict, settings.fmu, settings.map_ending])
    add(LAYOUT.encode(), said.encode(), binary.encode(), switches.encode(), settings.channel_map or b"", folder.name.encode())
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.name != ABOUT):
        add(path.relative_to(folder).as_posix().encode(), path.read_bytes())
    return digest.hexdigest()


def _diagnosed(command: str, folder: Path, out: Path, campaign: Campaign, settings: Settings, children: Children) -> dict[str, bytes]:
    words = [command, "diagnose", str(folder), "--out", str(out), "--threads", "1"]
    words += [*(["--strict"] if settings.strict else []), *([] if settings.fmu else ["--no-fmu"])]
    if settings.channel_map is not None:
        path = out.with_name(f"channels{settings.map_ending}")
        path.write_bytes(settings.channel_map)
        words += ["--channel-map", str(path)]
    try:
        code, said = children.run(words, settings.timeout_s)
    except subprocess.TimeoutExpired:
        raise _command.KisspointError(f"{campaign.url}: the diagnosis took longer than {settings.timeout_s:g} s; allow more, or look at the recordings") from None
    if code != 0:
        if children.stopped.is_set():
            raise InterruptedError("cancelled")
        # The command's last line points to its help, which is of no use in a table.
        lines = [line for line in said.strip().splitlines() if not line.startswith("For usage and examples")]
        message = "\n".join(lines).replace(str(folder), campaign.url).rpartition("kisspoint: ")[2].strip()
        if code == 1:
            raise _command.KisspointError(message or "the command refused without a word")
        raise Passing(f"the command ended with {code}{': ' + message if message else ''}")
    files = {path.name: path.read_bytes() for path in out.iterdir() if not path.name.startswith(".")}
    return files | {"vehicle.json": (folder / "vehicle.json").read_bytes()}


def _packed(files: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=3) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _unpacked(content: bytes | None) -> dict[str, bytes] | None:
    """The files of a cache entry; None if the entry is incomplete (because a store lost part of it)."""
    if content is None:
        return None
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    except (zipfile.BadZipFile, EOFError):
        return None


def _published(files: Mapping[str, bytes], key: str, folder: Place) -> Row:
    """Writes the answer into its folder, unless it is there already."""
    mark = folder / "answer.key"
    if mark.read() != key.encode():
        for name, content in files.items():
            (folder / name).write(content)
        mark.write(key.encode())
    return {"diagnosis": (folder / "diagnosis.json").url, "report": (folder / "report.html").url}


def _about(path: Path, campaign: Campaign) -> Row:
    """Car, mileage and date as the campaign states them."""
    if not path.is_file():
        return {}
    try:
        said = json.loads(path.read_text(encoding="utf-8-sig"))
        if not isinstance(said, dict):
            raise ValueError("is not an object")
        return about(said)
    except ValueError as error:
        raise _command.KisspointError(f"{campaign.url}/{ABOUT}: {error}; give car, mileage_km (a number) and date (\"2026-03-01\"), or some of them") from None


def about(said: Mapping[str, Any]) -> Row:
    """car, mileage_km and date from the given entries; keys that begin with `_` are comments."""
    from datetime import date, datetime

    unknown = [key for key in said if key not in ("car", "mileage_km", "date") and not key.startswith("_")]
    if unknown:
        raise ValueError(f"unknown key {unknown[0]!r}")
    row: Row = {}
    if said.get("car") is not None:
        row["car"] = str(said["car"])
    if said.get("mileage_km") is not None:
        mileage = said["mileage_km"]
        if isinstance(mileage, bool) or not isinstance(mileage, int | float) or not 0 <= mileage < 1e8:
            raise ValueError(f"mileage_km is {mileage!r}")
        row["mileage_km"] = float(mileage)
    if said.get("date") is not None:
        day = said["date"]
        try:
            row["date"] = day.date() if isinstance(day, datetime) else day if isinstance(day, date) else datetime.fromisoformat(str(day)).date()
        except ValueError:
            raise ValueError(f"date is {day!r}") from None
    return row
