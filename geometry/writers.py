"""Write meshes in every form that `read_mesh` reads, without loss."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.io import savemat

from nonrigid.geometry.errors import InputError
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh


def write_mesh(mesh: Mesh, path: str | PathLike[str]) -> None:
    """Write a mesh in the form that the suffix tells: `.off`, `.obj`, `.ply`, `.vert` (with its `.tri`) or `.mat`.

    `read_mesh` gives back vertices and faces bit for bit, in their order.

    Raises
    ------
    InputError
        For another suffix.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from nonrigid.geometry.io import read_mesh
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "corner.ply")
    ...     write_mesh(Mesh([[0, 0, 0], [0.1, 0, 0], [0, 2, 0]], [[0, 1, 2]]), path)
    ...     read_mesh(path).vertices[1]
    array([0.1, 0. , 0. ])
    """
    path = Path(path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise InputError(
            f"the suffix {path.suffix!r} is none of {', '.join(sorted(_WRITERS))}", file=path, remedy="use one of these"
        )
    writer(mesh, path)


def _obj(mesh: Mesh, path: Path) -> None:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")


def _ply(mesh: Mesh, path: Path) -> None:
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(mesh.vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    path.write_bytes(header.encode("ascii") + mesh.vertices.astype("<f8").tobytes() + faces.tobytes())


def _vert_tri(mesh: Mesh, path: Path) -> None:
    vertices = [f"{x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist()]
    path.write_text("".join(vertices), encoding="ascii", newline="\n")
    faces = [f"{a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist()]
    path.with_suffix(".tri").write_text("".join(faces), encoding="ascii", newline="\n")


def _mat(mesh: Mesh, path: Path) -> None:
    x, y, z = mesh.vertices.T[:, :, None]
    savemat(path, {"surface": {"X": x, "Y": y, "Z": z, "TRIV": (mesh.faces + 1).astype(np.float64)}})


_WRITERS: dict[str, Callable[[Mesh, Path], None]] = {
    ".off": write_off,
    ".obj": _obj,
    ".ply": _ply,
    ".vert": _vert_tri,
    ".mat": _mat,
}
