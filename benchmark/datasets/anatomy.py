"""The built-in creatures: bones, the flesh about them, and poses.

Lengths are in units of about a body length; x points to the creature's left, y up, z forward. Whatever is named `.L` is
built a second time as its mirror image `.R`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]


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
        Radius of the flesh at both ends.
    """

    name: str
    parent: str
    start: Vector
    end: Vector
    radii: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Flesh:
    """Describe an ellipsoid of flesh that `bone` carries, by its centre and its half axes along x, y and z."""

    bone: str
    centre: Vector
    radii: Vector


@dataclass(frozen=True, kw_only=True)
class Anatomy:
    """Describe a creature: its bones, flesh and poses.

    Parameters
    ----------
    name
        The class.
    bones, flesh
        Left and middle ones; see `both_sides`.
    poses
        For each pose, the rotation vector in degrees by which each named bone is turned against its parent.
    blend
        Length over which neighbouring flesh melts together.
    softness
        Length over which skin follows two bones at a joint.
    """

    name: str
    bones: tuple[Bone, ...]
    flesh: tuple[Flesh, ...]
    poses: tuple[dict[str, Vector], ...]
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
    return (
        replace(
            bone,
            name=_right(bone.name),
            parent=_right(bone.parent),
            start=_reflected(bone.start),
            end=_reflected(bone.end),
        ),
    )


def _mirrored_flesh(flesh: Flesh) -> tuple[Flesh, ...]:
    if flesh.centre[0] == 0.0:
        return ()
    return (replace(flesh, bone=_right(flesh.bone), centre=_reflected(flesh.centre)),)


def _right(name: str) -> str:
    return name[:-2] + ".R" if name.endswith(".L") else name


def _reflected(place: Vector) -> Vector:
    return (-place[0], place[1], place[2])


FOX = Anatomy(
    name="fox",
    blend=0.022,
    softness=0.075,
    bones=(
        Bone(name="pelvis", parent="", start=(0, 0.62, -0.12), end=(0, 0.61, -0.42), radii=(0.135, 0.125)),
        Bone(name="chest", parent="pelvis", start=(0, 0.62, -0.12), end=(0, 0.61, 0.24), radii=(0.14, 0.165)),
        Bone(name="neck", parent="chest", start=(0, 0.68, 0.30), end=(0, 0.90, 0.47), radii=(0.125, 0.085)),
        Bone(name="head", parent="neck", start=(0, 0.93, 0.52), end=(0, 0.90, 0.60), radii=(0.115, 0.09)),
        Bone(name="tail1", parent="pelvis", start=(0, 0.67, -0.50), end=(0, 0.60, -0.76), radii=(0.045, 0.07)),
        Bone(name="tail2", parent="tail1", start=(0, 0.60, -0.76), end=(0, 0.56, -1.05), radii=(0.085, 0.03)),
        Bone(name="arm.L", parent="chest", start=(0.10, 0.55, 0.26), end=(0.13, 0.34, 0.20), radii=(0.085, 0.055)),
        Bone(name="forearm.L", parent="arm.L", start=(0.13, 0.34, 0.20), end=(0.13, 0.10, 0.23), radii=(0.05, 0.036)),
        Bone(name="forepaw.L", parent="forearm.L", start=(0.13, 0.07, 0.23), end=(0.13, 0.045, 0.31),
             radii=(0.04, 0.042)),
        Bone(name="thigh.L", parent="pelvis", start=(0.10, 0.57, -0.40), end=(0.14, 0.36, -0.31), radii=(0.115, 0.07)),
        Bone(name="shin.L", parent="thigh.L", start=(0.14, 0.36, -0.31), end=(0.13, 0.18, -0.46), radii=(0.06, 0.036)),
        Bone(name="hindpaw.L", parent="shin.L", start=(0.13, 0.18, -0.46), end=(0.13, 0.045, -0.40),
             radii=(0.036, 0.036)),
    ),
    flesh=(
        Flesh(bone="head", centre=(0, 0.865, 0.70), radii=(0.062, 0.055, 0.15)),
        Flesh(bone="head", centre=(0, 0.885, 0.845), radii=(0.026, 0.024, 0.026)),
        Flesh(bone="head", centre=(0.075, 1.07, 0.47), radii=(0.042, 0.12, 0.026)),
        Flesh(bone="head", centre=(0.075, 0.86, 0.56), radii=(0.055, 0.045, 0.06)),
        Flesh(bone="chest", centre=(0, 0.53, 0.24), radii=(0.115, 0.14, 0.13)),
        Flesh(bone="forepaw.L", centre=(0.13, 0.04, 0.29), radii=(0.05, 0.035, 0.075)),
        Flesh(bone="hindpaw.L", centre=(0.13, 0.038, -0.37), radii=(0.045, 0.033, 0.09)),
    ),
    poses=(
        {  # trotting
            "arm.L": (-28, 0, 0), "forearm.L": (14, 0, 0), "arm.R": (24, 0, 0), "forearm.R": (18, 0, 0),
            "thigh.L": (26, 0, 0), "shin.L": (-12, 0, 0), "thigh.R": (-24, 0, 0), "shin.R": (14, 0, 0),
            "neck": (16, 0, 0), "head": (-10, 0, 0), "tail1": (18, 10, 0), "tail2": (14, 12, 0), "chest": (0, 6, 0),
        },
        {  # looking round
            "chest": (0, 14, 0), "neck": (-6, 26, 0), "head": (4, 24, 6), "tail1": (24, -22, 0), "tail2": (16, -26, 0),
            "arm.R": (-14, 0, 0), "forearm.R": (10, 0, 0), "thigh.L": (-12, 0, 0), "shin.L": (10, 0, 0),
        },
        {  # sniffing at the ground
            "chest": (8, 0, 0), "neck": (42, 0, 0), "head": (8, -8, 0), "arm.L": (-22, 0, 0), "forearm.L": (4, 0, 0),
            "arm.R": (6, 0, 0), "forearm.R": (6, 0, 0), "thigh.R": (18, 0, 0), "shin.R": (-14, 0, 0),
            "tail1": (-16, 0, 0), "tail2": (-22, 14, 0),
        },
    ),
)  # fmt: skip

TROLL = Anatomy(
    name="troll",
    blend=0.02,
    softness=0.07,
    bones=(
        Bone(name="pelvis", parent="", start=(0, 1.12, 0.0), end=(0, 0.98, -0.01), radii=(0.135, 0.145)),
        Bone(name="chest", parent="pelvis", start=(0, 1.12, 0.0), end=(0, 1.40, -0.01), radii=(0.135, 0.15)),
        Bone(name="neck", parent="chest", start=(0, 1.49, -0.01), end=(0, 1.63, 0.02), radii=(0.075, 0.065)),
        Bone(name="head", parent="neck", start=(0, 1.72, 0.03), end=(0, 1.80, 0.03), radii=(0.125, 0.125)),
        Bone(name="arm.L", parent="chest", start=(0.19, 1.43, -0.01), end=(0.40, 1.24, -0.03), radii=(0.08, 0.058)),
        Bone(name="forearm.L", parent="arm.L", start=(0.40, 1.24, -0.03), end=(0.60, 1.06, 0.02), radii=(0.06, 0.04)),
        Bone(name="hand.L", parent="forearm.L", start=(0.62, 1.04, 0.025), end=(0.72, 0.94, 0.045),
             radii=(0.045, 0.042)),
        Bone(name="thigh.L", parent="pelvis", start=(0.10, 0.94, 0.0), end=(0.135, 0.54, 0.025), radii=(0.115, 0.072)),
        Bone(name="shin.L", parent="thigh.L", start=(0.135, 0.54, 0.025), end=(0.14, 0.12, -0.02), radii=(0.07, 0.045)),
        Bone(name="foot.L", parent="shin.L", start=(0.14, 0.07, -0.03), end=(0.165, 0.045, 0.17), radii=(0.055, 0.045)),
    ),
    flesh=(
        Flesh(bone="head", centre=(0, 1.72, 0.18), radii=(0.032, 0.05, 0.085)),
        Flesh(bone="head", centre=(0, 1.63, 0.09), radii=(0.06, 0.05, 0.07)),
        Flesh(bone="head", centre=(0.165, 1.77, 0.01), radii=(0.085, 0.055, 0.026)),
        Flesh(bone="chest", centre=(0.07, 1.37, 0.07), radii=(0.10, 0.085, 0.08)),
        Flesh(bone="pelvis", centre=(0, 1.10, 0.09), radii=(0.12, 0.13, 0.11)),
        Flesh(bone="pelvis", centre=(0.075, 0.95, -0.09), radii=(0.085, 0.09, 0.08)),
        Flesh(bone="hand.L", centre=(0.635, 1.03, 0.095), radii=(0.024, 0.035, 0.058)),
        Flesh(bone="hand.L", centre=(0.75, 0.91, 0.05), radii=(0.05, 0.05, 0.034)),
    ),
    poses=(
        {  # walking
            "thigh.L": (-30, 0, 0), "shin.L": (16, 0, 0), "thigh.R": (16, 0, 0), "shin.R": (28, 0, 0),
            "arm.L": (24, 0, -16), "forearm.L": (-18, 0, 0), "arm.R": (-26, 0, 14), "forearm.R": (-26, 0, 0),
            "chest": (4, -8, 0), "head": (0, 8, 0),
        },
        {  # waving
            "arm.L": (0, -10, 42), "forearm.L": (0, -18, 46), "arm.R": (0, 0, 22), "forearm.R": (-34, 0, 0),
            "chest": (0, 0, -8), "neck": (0, 0, 8), "head": (0, 18, 0), "thigh.R": (0, 0, -8), "thigh.L": (0, 0, 6),
        },
        {  # half sitting
            "thigh.L": (-46, 0, 0), "shin.L": (50, 0, 0), "thigh.R": (-38, 0, 0), "shin.R": (44, 0, 0),
            "chest": (24, 0, 0), "neck": (-10, 0, 0), "head": (-10, -14, 0), "arm.L": (-36, 0, 0),
            "forearm.L": (-22, 0, 0), "arm.R": (-30, 0, -6), "forearm.R": (-30, 0, 0),
        },
    ),
)  # fmt: skip

ANATOMIES = (FOX, TROLL)
