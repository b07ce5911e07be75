"""List and read files alike, whether they lie in a folder or in a zip archive."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import read_mesh
from nonrigid.geometry.mesh import Mesh

_PARTNERS = {".vert": ".tri"}
"""Suffixes of files that cannot be read without the one of the same name beside them."""


@dataclass(frozen=True)
class Member:
    """Name a file in a zip archive; it is unpacked for as long as it is read, and nowhere near the user's files.

    Parameters
    ----------
    archive
        The zip file.
    name
        The file in it, with folders, as the archive spells it.
    """

    archive: Path
    name: str

    def __str__(self) -> str:
        return f"{self.archive}/{self.name}"

    def __fspath__(self) -> str:
        return str(self)


FileSource: TypeAlias = Path | Member


@dataclass(frozen=True, kw_only=True)
class Tree:
    """Hold the files under a root, by their path relative to it, with `/` between folders, in sorted order.

    Zip archives that lie in the root itself count as folders of their names without the suffix.
    """

    root: Path
    files: Mapping[str, FileSource]

    def name_of(self, folder: str) -> str:
        """Return what to call a folder of this tree: its own name, or that of the root."""
        return folder.rpartition("/")[2] or bare_name(self.root)

    def place_of(self, folder: str) -> Path:
        """Return a folder of this tree as a path, for messages."""
        return self.root / folder if folder else self.root


def list_tree(root: Path | str) -> Tree:
    """List what lies in a folder or a zip archive, and in the zip archives of that folder.

    Hidden files and those that archivers add are passed over.

    Raises
    ------
    InputError
        If there is no such folder or file, or it is no zip archive, or a damaged one.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with zipfile.ZipFile(Path(folder, "a.zip"), "w") as archive:
    ...         archive.writestr("cuts/x.off", "OFF")
    ...     list(list_tree(folder).files), list(list_tree(Path(folder, "a.zip")).files)
    (['a/cuts/x.off'], ['cuts/x.off'])
    """
    root = Path(root)
    if root.is_dir():
        found: dict[str, FileSource] = {}
        for path in sorted(root.rglob("*")):
            if not path.is_file():
                continue
            inner = path.relative_to(root).as_posix()
            if path.suffix.lower() == ".zip" and path.parent == root:
                found |= {f"{path.stem}/{name}": source for name, source in _members(path).items()}
            else:
                found[inner] = path
    elif root.is_file():
        found = dict(_members(root))
    else:
        raise InputError("there is no such folder or archive", file=root, remedy="check the path")
    return Tree(root=root, files={name: found[name] for name in sorted(found) if not _is_litter(name)})


@contextmanager
def local_file(source: FileSource) -> Iterator[Path]:
    """Give a path at which a file can be read while the context lasts; errors name the archive, not that path.

    Raises
    ------
    InputError
        If the archive is gone or damaged, or has no such member.
    """
    if isinstance(source, Path):
        yield source
        return
    with tempfile.TemporaryDirectory(prefix="nonrigid-") as folder:
        path = Path(folder, source.name.rpartition("/")[2])
        _unpack(source, path)
        partner = _PARTNERS.get(path.suffix)
        if partner is not None:
            _unpack(Member(source.archive, str(Path(source.name).with_suffix(partner))), path.with_suffix(partner))
        try:
            yield path
        except InputError as error:
            named = str(error.file or "")
            shown = str(source.archive / Path(source.name).parent / Path(named).name) if named else str(source)
            shown = shown if named.startswith(folder) or not named else named
            raise InputError(error.problem, file=shown, row=error.row, remedy=error.remedy) from None


def load_mesh(source: FileSource) -> Mesh:
    """Read a mesh from a file or from a member of an archive; raise `InputError` as `read_mesh` does.

    The last files are remembered as long as they do not change: the parts of one class share their full shape, and what
    has been derived from it.
    """
    if isinstance(source, Path) and source.is_file():
        now = source.stat()
        return _remembered(source, (now.st_dev, now.st_ino, now.st_mtime_ns, now.st_size))
    with local_file(source) as path:
        mesh = read_mesh(path)
    return mesh if path == source else Mesh(mesh.vertices, mesh.faces, name=mesh.name, file=str(source))


@lru_cache(maxsize=4)
def _remembered(path: Path, identity: tuple[int, ...]) -> Mesh:
    return read_mesh(path)


def exists(source: FileSource) -> bool:
    """Tell whether a file is there; a member counts as there if its archive is."""
    return source.is_file() if isinstance(source, Path) else source.archive.is_file()


def bare_name(root: Path) -> str:
    """Return the name of a folder or archive, without the suffix of an archive."""
    return root.resolve().stem if root.suffix.lower() == ".zip" else root.resolve().name


def _members(path: Path) -> dict[str, FileSource]:
    with _opened(path) as archive:
        return {info.filename: Member(path, info.filename) for info in archive.infolist() if not info.is_dir()}


def _unpack(member: Member, path: Path) -> None:
    with _opened(member.archive) as archive:
        try:
            with archive.open(member.name) as packed, path.open("wb") as stream:
                shutil.copyfileobj(packed, stream)
        except KeyError:
            raise InputError("the archive has no such file", file=member, remedy="complete the archive") from None
        # The last is what zipfile raises for a password or a compression that it does not know.
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:
            raise InputError(f"cannot be unpacked: {error}", file=member, remedy="fetch the archive again") from None


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        archive = zipfile.ZipFile(path)
    except FileNotFoundError:
        raise InputError("there is no such archive", file=path, remedy="check the path") from None
    except (zipfile.BadZipFile, OSError) as error:
        raise InputError(
            f"is no zip archive, or a truncated one: {error}", file=path, remedy="fetch it again, or unpack it"
        ) from None
    with archive:
        yield archive


def _is_litter(name: str) -> bool:
    parts = name.split("/")
    return any(part.startswith(".") or part == "__MACOSX" for part in parts)
