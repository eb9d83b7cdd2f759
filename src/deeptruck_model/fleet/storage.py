"""File storage: a local folder, or a bucket through pyarrow. Files are read and written as a whole."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import posixpath
import re
import secrets
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pyarrow import fs

from deeptruck_core import reading
from deeptruck_core.errors import InputError

TRIES = 5  # of one transfer; storage that fails half the time then fails one in 32
WAIT_S = 0.2  # before the second try, doubled before each further one
PIECE = 4 * 2**20  # bytes of one read
BUCKETS = ("s3", "gcs")  # which have no folders to make


@dataclass(frozen=True)
class Stored:
    """A file listed by its storage: `path` relative to the place, size in bytes, and modification
    time in ns."""

    path: str
    size: int
    changed_ns: int


@dataclass(frozen=True)
class Place:
    """A folder or the prefix of a bucket: a path, and its file system, which can be sent to other
    processes."""

    files: fs.FileSystem
    path: str
    name: str

    def at(self, path: str) -> str:
        """The full path of a file in the place."""
        return posixpath.join(self.path, path)

    def list(self, below: str = "") -> list[Stored]:
        """All files below, by name; none if `below` does not exist. Raises InputError if the storage
        refuses."""
        selector = fs.FileSelector(
            self.at(below) if below else self.path, recursive=True, allow_not_found=True
        )
        start = len(self.path.rstrip("/")) + 1
        found = self._tried("list", lambda: self.files.get_file_info(selector))
        kept = [
            Stored(info.path[start:], info.size, info.mtime_ns or 0)
            for info in found
            if info.type == fs.FileType.File
        ]
        shown = [f for f in kept if not any(part.startswith(".") for part in f.path.split("/"))]
        return sorted(shown, key=lambda f: f.path)

    def exists(self, path: str) -> bool:
        """Whether a file exists."""
        info = self._tried(path, lambda: self.files.get_file_info(self.at(path)))
        return bool(info.type == fs.FileType.File)

    def read(self, path: str) -> bytes:
        """The content of a small file. Raises InputError if it cannot be read."""

        def content() -> bytes:
            with self.files.open_input_stream(self.at(path)) as stream:
                return bytes(stream.read())

        return bytes(self._tried(path, content))

    def read_json(self, path: str) -> dict[str, Any]:
        """A JSON object. Raises InputError if it cannot be read, or is not one."""
        try:
            data = json.loads(self.read(path))
        except ValueError:
            data = None
        if not isinstance(data, dict):
            raise InputError(f"{self.name}/{path} is damaged; remove it, and run the stage again")
        return data

    def read_table(
        self, path: str, columns: Collection[str], numbers: Collection[str]
    ) -> tuple[dict[str, Any], ...]:
        """The rows of a CSV file by its header; columns in `numbers` as float. Raises InputError if it cannot
        be read, a row lacks one of the columns, or a value is not a number."""
        where, rows = f"{self.name}/{path}", list[dict[str, Any]]()
        cure = "restore it, or start a new result"
        try:
            table = csv.DictReader(io.StringIO(self.read(path).decode()))
            for row in table:
                if any(row.get(column) is None for column in columns):
                    raise InputError(f"{where} is damaged; {cure}")
                line = f"{where}, line {table.line_num}"
                found = {c: reading.number_in_cell(row[c], f"{line}: {c}", cure) for c in numbers}
                rows.append({**row, **found})
        except (UnicodeDecodeError, csv.Error):
            raise InputError(f"{where} is damaged; {cure}") from None
        return tuple(rows)

    def write(self, path: str, content: bytes) -> None:
        """Write a file under a temporary name, then rename it. Raises InputError if that fails."""
        draft = f"{posixpath.dirname(path)}/.{posixpath.basename(path)}.{secrets.token_hex(4)}".lstrip("/")

        def put() -> None:
            if self.files.type_name not in BUCKETS:
                self.files.create_dir(posixpath.dirname(self.at(path)), recursive=True)
            with self.files.open_output_stream(self.at(draft)) as stream:
                stream.write(content)
            self.files.move(self.at(draft), self.at(path))

        try:
            self._tried(path, put)
        finally:
            with suppress(OSError):
                if self.files.get_file_info(self.at(draft)).type == fs.FileType.File:
                    self.files.delete_file(self.at(draft))

    def write_json(self, path: str, data: Any) -> None:
        """Write JSON, with equal bytes for equal data."""
        self.write(path, (json.dumps(data, indent=1, sort_keys=True) + "\n").encode())

    def delete(self, path: str) -> None:
        """Remove a file that this command wrote; a missing file is no error."""
        with suppress(FileNotFoundError):
            self._tried(path, lambda: self.files.delete_file(self.at(path)))

    @contextmanager
    def copied(self, path: str) -> Iterator[tuple[Path, str]]:
        """A local copy of a file, with its name, for the duration of a block, and its SHA-256. Each byte is
        read once, unless the storage fails. Raises InputError if it cannot be read."""
        with TemporaryDirectory(prefix="deeptruck-fleet-") as folder:
            copy = Path(folder) / posixpath.basename(path)

            def fetch() -> str:
                digest = hashlib.sha256()
                with self.files.open_input_stream(self.at(path)) as stream, copy.open("wb") as out:
                    while piece := stream.read(PIECE):
                        digest.update(piece)
                        out.write(piece)
                return digest.hexdigest()

            yield copy, str(self._tried(path, fetch))

    def _tried(self, what: str, act: Any) -> Any:
        for attempt in range(TRIES):
            try:
                return act()
            except OSError as error:
                denied = any(word in str(error) for word in ("ACCESS_DENIED", "Access Denied"))
                if denied or isinstance(error, FileNotFoundError | PermissionError):
                    raise StorageError(f"{self.name}: {what}: {_says(error)}") from None
                if attempt == TRIES - 1:
                    raise StorageError(f"{self.name}: {what} failed {TRIES} times: {_says(error)}") from None
                time.sleep(WAIT_S * 2**attempt)
        raise AssertionError


class StorageError(InputError):
    """The storage failed or refused; the state of the file is unknown, and a later run tries again."""


def place(uri: str, endpoint: str | None = None) -> Place:
    """A folder, `file://`, `s3://` or `gs://`; `endpoint` is that of an S3 server other than Amazon's.

    Nothing is read. Raises InputError for any other address.
    """
    try:
        if "://" not in uri:
            return Place(fs.LocalFileSystem(), str(Path(uri).absolute()), uri.rstrip("/") or "/")
        if endpoint is not None and uri.startswith("s3://"):
            scheme, _, host = endpoint.rpartition("://")
            server = fs.S3FileSystem(
                endpoint_override=host.rstrip("/"),
                scheme=scheme or "https",
                region="us-east-1",
                allow_delayed_open=True,
            )
            return Place(server, uri.removeprefix("s3://").strip("/"), uri.rstrip("/"))
        one_request = "?allow_delayed_open=true"  # puts a file of some MB; else it takes three
        asked = uri + one_request if uri.startswith("s3://") and "?" not in uri else uri
        files, path = fs.FileSystem.from_uri(asked)
    except (OSError, ValueError, NotImplementedError) as error:
        raise InputError(f"{uri} is no storage that can be reached: {_says(error)}") from None
    return Place(files, path.rstrip("/"), uri.rstrip("/"))


@cache
def code(*rooms: str) -> str:
    """Version and SHA-256 of this package's source, or of the named subpackages only: results of another
    version are computed again. Equal for equal source on every machine."""
    from importlib.metadata import version

    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.suffix in (".py", ".npz", ".json", ".yaml") and name.startswith(rooms or ("",)):
            digest.update(name.encode() + b"\0" + path.read_bytes())
    return f"{version('deeptruck')}-{digest.hexdigest()[:12]}"


def key(*parts: object) -> str:
    """A short hash of data, equal on every machine."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:16]


def _says(error: BaseException) -> str:
    """The first sentence of a storage library's error, on one line."""
    text = " ".join(str(error).split()) or type(error).__name__
    return re.split(r"\. Detail|, detail:", text)[0][:200]
