"""Say in data what a creature is made of: bones, the flesh about them, and poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Pose: TypeAlias = dict[str, Vector]
"""For each turned bone, the rotation vector in degrees by which it is turned against its parent."""


@dataclass(frozen=True, kw_only=True)
class Bone:
    """Describe a bone, which turns about its start, and the round flesh about it.

    Parameters
    ----------
    name, parent
        Its name, and that of the bone that carries it (empty for the root).
    start, end
        Where it lies in the neutral pose.
    radii
        Radius of the flesh at both ends; where zero at both, the bone has none but what is hung on it.
    """

    name: str
    parent: str
    start: Vector
    end: Vector
    radii: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Cone:
    """Describe a round cone of flesh that `bone` carries, by its ends, the radii there and its own blend, if any."""

    bone: str
    start: Vector
    end: Vector
    radii: tuple[float, float]
    blend: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Ellipsoid:
    """Describe an ellipsoid of flesh that `bone` carries.

    Parameters
    ----------
    centre, radii
        Its centre, and its half axes along x, y and z.
    turn
        Rotation vector in degrees by which it is then turned about its centre.
    blend
        Length over which it melts into its neighbours; that of the anatomy where zero.
    """

    bone: str
    centre: Vector
    radii: Vector
    turn: Vector = (0.0, 0.0, 0.0)
    blend: float = 0.0


Flesh: TypeAlias = Cone | Ellipsoid


@dataclass(frozen=True, kw_only=True)
class Anatomy:
    """Describe a creature: its bones, flesh and poses, looking along z, with y up and its left along x.

    Parameters
    ----------
    name
        The class.
    bones, flesh
        Left and middle ones; see `both_sides`.
    poses
        At least one.
    blend
        Length over which neighbouring flesh melts together.
    softness
        Length over which skin follows two bones at a joint.
    """

    name: str
    bones: tuple[Bone, ...]
    flesh: tuple[Flesh, ...]
    poses: tuple[Pose, ...]
    blend: float
    softness: float

    def both_sides(self) -> Anatomy:
        """Return the anatomy with the right side written out."""
        bones = [part for bone in self.bones for part in (bone, *_mirrored_bone(bone))]
        flesh = [part for lump in self.flesh for part in (lump, *_mirrored_flesh(lump))]
        return replace(self, bones=tuple(bones), flesh=tuple(flesh))


def _mirrored_bone(bone: Bone) -> tuple[Bone, ...]:
    if not bone.name.endswith(".L"):
        return ()
    start, end = _reflected(bone.start), _reflected(bone.end)
    return (replace(bone, name=_right(bone.name), parent=_right(bone.parent), start=start, end=end),)


def _mirrored_flesh(flesh: Flesh) -> tuple[Flesh, ...]:
    if isinstance(flesh, Cone):
        if flesh.start[0] == flesh.end[0] == 0.0:
            return ()
        return (replace(flesh, bone=_right(flesh.bone), start=_reflected(flesh.start), end=_reflected(flesh.end)),)
    if flesh.centre[0] == 0.0:
        return ()
    x, y, z = flesh.turn
    return (replace(flesh, bone=_right(flesh.bone), centre=_reflected(flesh.centre), turn=(x, -y, -z)),)


def _right(name: str) -> str:
    return name[:-2] + ".R" if name.endswith(".L") else name


def _reflected(place: Vector) -> Vector:
    return (-place[0], place[1], place[2])
