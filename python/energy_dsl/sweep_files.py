"""The files that a run of a sweep reads and writes: fingerprints, and records that are whole or absent."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

from . import _energy

#: Files in the folder of a run that are not its results.
NOT_RESULTS = {"cloth.lock", "report.html", ".cloth-write-probe"}


def listed_inputs(text: str, path: str, known: dict[str, str]) -> list[tuple[str, str, str]]:
    """Returns the meshes and materials of a scene: path relative to the scene, path, and hash of the contents."""
    place = Path(path).parent
    found = []
    for file in map(str, _energy.input_files(text, path)):
        if file not in known:
            known[file] = fingerprint(file)
        found.append((os.path.relpath(file, place), file, known[file]))
    return found


def fingerprint(file: str | os.PathLike[str]) -> str:
    """Returns the SHA-256 of a file, or why it cannot be read."""
    digest = hashlib.sha256()
    try:
        with open(file, "rb") as contents:
            while chunk := contents.read(1 << 20):
                digest.update(chunk)
    except OSError as error:
        return f"unreadable: {error.strerror}"
    return digest.hexdigest()


def result_files(folder: Path) -> dict[str, list[Any]]:
    """Lists the results of a run: size in bytes, time of the last change in ns, and SHA-256 of each file."""
    found: dict[str, list[Any]] = {}
    for file in sorted(folder.rglob("*")):
        name = file.relative_to(folder).as_posix()
        if file.is_file() and name not in NOT_RESULTS and not name.startswith("sweep."):
            state = file.stat()
            found[name] = [state.st_size, state.st_mtime_ns, fingerprint(file)]
    return found


def damage(folder: Path, files: dict[str, list[Any]]) -> str:
    """Returns how the results of a run differ from what it wrote; empty if all are whole. Contents are read only where
    a file has the right size but was changed later."""
    for name, (size, changed, digest) in files.items():
        file = folder / name
        try:
            state = file.stat()
        except OSError as error:
            return f"{file} cannot be read ({error.strerror})"
        if state.st_size != size:
            return f"{file} has {state.st_size} bytes, but the run wrote {size}"
        if state.st_mtime_ns != changed and fingerprint(file) != digest:
            return f"{file} was changed after the run wrote it"
    return ""


def replace(path: Path, text: str) -> None:
    """Writes a file whole or not at all, and onto the disk. Parts that killed processes have left are removed.

    Raises OSError, which names the file.
    """
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with part.open("w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        for left in path.parent.glob(f"{path.name}.*.part"):
            left.unlink(missing_ok=True)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from error
