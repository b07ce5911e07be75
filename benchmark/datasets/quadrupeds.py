"""Four-legged creatures: cat, dog, wolf and horse."""

from __future__ import annotations

from dataclasses import dataclass

from nonrigid.benchmark.datasets.anatomy import Anatomy, Bone, Cone, Ellipsoid, Flesh, Pose, Vector


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Describe the trunk and the legs of a four-legged creature, in units of about its length.

    Parameters
    ----------
    shoulder, hip
        Height and place along z of the shoulder and hip joints.
    chest, waist, rump
        Half width and half height of the trunk at its chest, waist and rump.
    stance
        Half the width between left and right legs.
    fore, hind
        Radii of the legs at the upper joint, at elbow or knee, at wrist or heel, and above the foot.
    wrist, heel
        Height of these joints.
    foot
        Half width, half height and half length of a paw or hoof.
    hooves
        Whether the feet are hooves.
    """

    shoulder: tuple[float, float]
    hip: tuple[float, float]
    chest: tuple[float, float]
    waist: tuple[float, float]
    rump: tuple[float, float]
    stance: float
    fore: tuple[float, float, float, float]
    hind: tuple[float, float, float, float]
    wrist: float
    heel: float
    foot: Vector
    hooves: bool = False


@dataclass(frozen=True, kw_only=True)
class Tail:
    """Describe a tail by where it starts behind the rump, its three next joints and the four radii there."""

    joints: tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]
    radii: tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Face:
    """Describe neck and head.

    Parameters
    ----------
    root, nape, skull
        Height and place along z of the lower and upper end of the neck and of the middle of the skull.
    neck
        Half thickness at both ends.
    skull_radii
        Half axes of the skull.
    muzzle
        Height and place along z of its tip, and radii at root and tip.
    ear
        Its place (left) and half axes, and how it is turned.
    """

    root: tuple[float, float]
    nape: tuple[float, float]
    skull: tuple[float, float]
    neck: tuple[float, float]
    skull_radii: Vector
    muzzle: tuple[float, float, float, float]
    ear: Vector
    ear_radii: Vector
    ear_turn: Vector


def quadruped(name: str, frame: Frame, face: Face, tail: Tail, poses: tuple[Pose, ...], *, blend: float) -> Anatomy:
    """Return the anatomy of a creature on four legs."""
    bones, flesh = trunk_and_legs(frame, tail)
    head_bones, head = _neck_and_head(face, blend)
    return Anatomy(
        name=name,
        bones=(*bones, *head_bones),
        flesh=(*flesh, *head),
        poses=poses,
        blend=blend,
        softness=0.06,
    )


def trunk_and_legs(f: Frame, tail: Tail) -> tuple[tuple[Bone, ...], tuple[Flesh, ...]]:
    """Return spine, legs and tail; the root is `loin`, in the middle of the back."""
    (sy, sz), (hy, hz) = f.shoulder, f.hip
    middle = 0.5 * (sz + hz)
    back = 0.5 * (sy + hy)
    s = f.stance
    elbow, wrist = (s, 0.56 * sy, sz - 0.05), (s, f.wrist, sz - 0.01)
    fore_tip = (s, f.foot[1] + 0.035, sz + 0.02)
    knee, heel = (s * 1.05, 0.60 * hy, hz + 0.10), (s, f.heel, hz - 0.085)
    hind_tip = (s, f.foot[1] + 0.035, hz - 0.035)
    joints = [(0.0, y, z) for y, z in tail.joints]
    r = tail.radii
    bones = (
        Bone(name="loin", parent="", start=(0, back, middle), end=(0, back, middle - 0.1)),
        Bone(name="withers", parent="loin", start=(0, back, middle + 0.05), end=(0, sy, sz)),
        Bone(name="rump", parent="loin", start=(0, back, middle - 0.12), end=(0, hy, hz)),
        Bone(name="tail1", parent="rump", start=joints[0], end=joints[1], radii=(r[0], r[1])),
        Bone(name="tail2", parent="tail1", start=joints[1], end=joints[2], radii=(r[1], r[2])),
        Bone(name="tail3", parent="tail2", start=joints[2], end=joints[3], radii=(r[2], r[3])),
        Bone(name="foreleg.L", parent="withers", start=(0.75 * s, sy, sz + 0.05), end=elbow,
             radii=(f.fore[0], f.fore[1])),
        Bone(name="foreshank.L", parent="foreleg.L", start=elbow, end=wrist, radii=(f.fore[1], f.fore[2])),
        Bone(name="forefoot.L", parent="foreshank.L", start=wrist, end=fore_tip, radii=(f.fore[2], f.fore[3])),
        Bone(name="thigh.L", parent="rump", start=(0.75 * s, hy, hz), end=knee, radii=(f.hind[0], f.hind[1])),
        Bone(name="shin.L", parent="thigh.L", start=knee, end=heel, radii=(f.hind[1], f.hind[2])),
        Bone(name="hindfoot.L", parent="shin.L", start=heel, end=hind_tip, radii=(f.hind[2], f.hind[3])),
    )  # fmt: skip
    length = sz - hz
    flesh: list[Flesh] = [
        Ellipsoid(bone="withers", centre=(0, sy - 0.35 * f.chest[1], sz - 0.08 * length),
                  radii=(f.chest[0], f.chest[1], 0.36 * length), blend=0.03),
        Ellipsoid(bone="withers", centre=(0, sy - 0.1 * f.chest[1], sz - 0.18 * length),
                  radii=(0.7 * f.chest[0], 0.82 * f.chest[1], 0.34 * length), turn=(10, 0, 0), blend=0.03),
        Ellipsoid(bone="loin", centre=(0, back - 0.02, middle - 0.02), radii=(f.waist[0], f.waist[1], 0.40 * length),
                  blend=0.03),
        Ellipsoid(bone="rump", centre=(0, hy - 0.05 * f.rump[1], hz + 0.08 * length),
                  radii=(f.rump[0], f.rump[1], 0.30 * length), blend=0.03),
        Ellipsoid(bone="foreleg.L", centre=(0.85 * s, 0.86 * sy, sz),
                  radii=(0.9 * f.fore[0], 0.17 * sy + 0.02, 1.15 * f.fore[0]),
                  turn=(12, 0, 0)),
        Ellipsoid(bone="thigh.L", centre=(0.85 * s, 0.86 * hy, hz + 0.03),
                  radii=(0.75 * f.hind[0], 0.22 * hy, 1.15 * f.hind[0]),
                  turn=(-16, 0, 0)),
        Ellipsoid(bone="shin.L", centre=_mid(knee, heel, 0.3), radii=(0.7 * f.hind[1], 0.11 * hy, 0.85 * f.hind[1]),
                  turn=(32, 0, 0)),
    ]  # fmt: skip
    for bone, tip in (("forefoot.L", fore_tip), ("hindfoot.L", hind_tip)):
        flesh += _hoof(bone, tip, f.foot) if f.hooves else _paw(bone, tip, f.foot)
    return bones, tuple(flesh)


def _paw(bone: str, tip: Vector, foot: Vector) -> list[Flesh]:
    x, _, z = tip
    w, h, length = foot
    toes: list[Flesh] = [
        Ellipsoid(bone=bone, centre=(x + side * w, 0.75 * h, z + 0.95 * length - 0.25 * abs(side) * length),
                  radii=(0.36 * w, 0.75 * h, 0.42 * length), blend=0.006)
        for side in (-0.72, -0.25, 0.25, 0.72)
    ]  # fmt: skip
    return [Ellipsoid(bone=bone, centre=(x, h, z + 0.3 * length), radii=(w, h, length), blend=0.012), *toes]


def _hoof(bone: str, tip: Vector, foot: Vector) -> list[Flesh]:
    x, y, z = tip
    w, h, length = foot
    return [
        Cone(bone=bone, start=(x, y + 0.02, z), end=(x, 1.1 * h, z + 0.35 * length), radii=(0.72 * w, w), blend=0.012),
        Ellipsoid(bone=bone, centre=(x, 0.7 * h, z + 0.4 * length), radii=(1.15 * w, 0.7 * h, length), blend=0.008),
    ]


def _neck_and_head(f: Face, blend: float) -> tuple[tuple[Bone, ...], tuple[Flesh, ...]]:
    root, nape, skull = ((0.0, *place) for place in (f.root, f.nape, f.skull))
    half = _mid(root, nape, 0.5)
    ty, tz, r0, r1 = f.muzzle
    tip = (0.0, ty, tz)
    wide, high, deep = f.skull_radii
    middle = 0.5 * (f.neck[0] + f.neck[1])
    bones = (
        Bone(name="neck1", parent="withers", start=root, end=half, radii=(f.neck[0], middle)),
        Bone(name="neck2", parent="neck1", start=half, end=nape, radii=(middle, f.neck[1])),
        Bone(name="head", parent="neck2", start=nape, end=skull),
    )
    mouth = _mid(skull, tip, 0.55)
    fine = 0.5 * blend
    flesh = (
        Ellipsoid(bone="head", centre=skull, radii=f.skull_radii),
        Cone(bone="head", start=_mid(skull, tip, 0.35), end=_mid(skull, tip, 0.93), radii=(r0, r1)),
        Cone(bone="head", start=_lower(_mid(skull, tip, 0.25), 0.55 * high),
             end=_lower(_mid(skull, tip, 0.86), 0.75 * r1),
             radii=(0.6 * r0, 0.62 * r1), blend=fine),
        Ellipsoid(bone="head", centre=_mid(skull, tip, 1.0), radii=(0.6 * r1, 0.5 * r1, 0.5 * r1), blend=fine),
        Ellipsoid(bone="head", centre=(0.62 * wide, skull[1] - 0.30 * high, skull[2] + 0.35 * deep),
                  radii=(0.5 * wide, 0.5 * high, 0.5 * deep)),
        Ellipsoid(bone="head", centre=(0.52 * wide,
                  *_mid((0.0, skull[1] + 0.42 * high, skull[2] + 0.72 * deep), mouth, 0.15)[1:]),
                  radii=(0.24 * wide, 0.20 * high, 0.24 * deep), blend=0.4 * fine),
        Ellipsoid(bone="head", centre=f.ear, radii=f.ear_radii, turn=f.ear_turn, blend=0.6 * fine),
        Ellipsoid(bone="neck1", centre=_lower(_mid(root, nape, 0.1), 0.3 * f.neck[0]),
                  radii=(0.85 * f.neck[0], 1.1 * f.neck[0], 0.9 * f.neck[0]), blend=0.03),
    )  # fmt: skip
    return bones, flesh


def _mid(first: Vector, second: Vector, share: float) -> Vector:
    x, y, z = ((1 - share) * a + share * b for a, b in zip(first, second, strict=True))
    return (x, y, z)


def _lower(place: Vector, by: float) -> Vector:
    return (place[0], place[1] - by, place[2])


CAT = (
    Frame(shoulder=(0.37, 0.20), hip=(0.38, -0.22), chest=(0.088, 0.105), waist=(0.092, 0.095), rump=(0.088, 0.10),
          stance=0.062,
          fore=(0.055, 0.038, 0.028, 0.026), hind=(0.075, 0.046, 0.026, 0.026), wrist=0.10, heel=0.13,
          foot=(0.032, 0.024, 0.04)),
    Face(root=(0.41, 0.27), nape=(0.505, 0.36), skull=(0.54, 0.41), neck=(0.072, 0.062),
         skull_radii=(0.078, 0.072, 0.078),
         muzzle=(0.512, 0.495, 0.038, 0.027), ear=(0.050, 0.615, 0.385), ear_radii=(0.034, 0.052, 0.014),
         ear_turn=(-8, 20, -22)),
    Tail(joints=((0.415, -0.30), (0.36, -0.46), (0.26, -0.58), (0.27, -0.74)), radii=(0.034, 0.027, 0.025, 0.021)),
)  # fmt: skip
DOG = (
    Frame(shoulder=(0.50, 0.23), hip=(0.49, -0.22), chest=(0.10, 0.15), waist=(0.082, 0.098), rump=(0.085, 0.10),
          stance=0.075,
          fore=(0.062, 0.044, 0.032, 0.029), hind=(0.082, 0.05, 0.029, 0.028), wrist=0.12, heel=0.155,
          foot=(0.036, 0.026, 0.048)),
    Face(root=(0.56, 0.31), nape=(0.70, 0.395), skull=(0.725, 0.44), neck=(0.088, 0.07),
         skull_radii=(0.078, 0.072, 0.088),
         muzzle=(0.68, 0.635, 0.052, 0.038), ear=(0.088, 0.70, 0.42), ear_radii=(0.016, 0.082, 0.045),
         ear_turn=(10, -10, 14)),
    Tail(joints=((0.53, -0.31), (0.595, -0.42), (0.69, -0.49), (0.77, -0.51)), radii=(0.036, 0.028, 0.023, 0.015)),
)  # fmt: skip
WOLF = (
    Frame(shoulder=(0.53, 0.26), hip=(0.51, -0.25), chest=(0.115, 0.17), waist=(0.098, 0.115), rump=(0.098, 0.115),
          stance=0.085,
          fore=(0.068, 0.046, 0.032, 0.030), hind=(0.092, 0.055, 0.031, 0.030), wrist=0.125, heel=0.18,
          foot=(0.042, 0.028, 0.056)),
    Face(root=(0.58, 0.34), nape=(0.69, 0.46), skull=(0.70, 0.52), neck=(0.125, 0.10),
         skull_radii=(0.090, 0.078, 0.095),
         muzzle=(0.64, 0.735, 0.052, 0.032), ear=(0.062, 0.805, 0.485), ear_radii=(0.034, 0.07, 0.018),
         ear_turn=(-12, 18, -14)),
    Tail(joints=((0.535, -0.35), (0.44, -0.46), (0.32, -0.53), (0.20, -0.57)), radii=(0.045, 0.062, 0.058, 0.024)),
)  # fmt: skip
HORSE = (
    Frame(shoulder=(0.76, 0.34), hip=(0.77, -0.34), chest=(0.145, 0.20), waist=(0.17, 0.205), rump=(0.155, 0.175),
          stance=0.095,
          fore=(0.085, 0.056, 0.036, 0.030), hind=(0.125, 0.072, 0.038, 0.032), wrist=0.33, heel=0.36,
          foot=(0.042, 0.036, 0.058), hooves=True),
    Face(root=(0.80, 0.46), nape=(1.16, 0.70), skull=(1.15, 0.755), neck=(0.135, 0.075),
         skull_radii=(0.070, 0.085, 0.095),
         muzzle=(0.915, 1.005, 0.066, 0.052), ear=(0.042, 1.27, 0.715), ear_radii=(0.018, 0.062, 0.022),
         ear_turn=(-14, 0, -12)),
    Tail(joints=((0.86, -0.50), (0.78, -0.62), (0.60, -0.67), (0.36, -0.69)), radii=(0.038, 0.052, 0.058, 0.028)),
)  # fmt: skip
