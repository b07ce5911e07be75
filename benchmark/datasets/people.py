"""Three people of different build."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nonrigid.benchmark.datasets.anatomy import Anatomy, Bone, Cone, Ellipsoid, Flesh, Pose, Vector


@dataclass(frozen=True, kw_only=True)
class Build:
    """Describe the build of a person, in metres.

    Parameters
    ----------
    leg, torso, arm, head
        Height of the hip, length from hip to neck, length from shoulder to wrist, and height of the head.
    shoulder, hip
        Half the width between the shoulder joints and between the hip joints.
    chest, waist, seat
        Half width and half depth of the ribs, the waist and the pelvis.
    limb
        Thickness of arms and legs, against an ordinary one.
    bust, belly
        How far chest and belly stand out.
    finger
        Thickness of the fingers, against ordinary ones.
    """

    leg: float
    torso: float
    arm: float
    head: float
    shoulder: float
    hip: float
    chest: tuple[float, float]
    waist: tuple[float, float]
    seat: tuple[float, float]
    limb: float
    bust: float
    belly: float
    finger: float = 1.0


def person(name: str, build: Build, poses: tuple[Pose, ...], *, blend: float = 0.016) -> Anatomy:
    """Return the anatomy of a person who stands with arms held away from the sides."""
    bones, flesh = torso_and_head(build, floor=build.leg)
    legs, leg_flesh = _legs(build)
    return Anatomy(
        name=name,
        bones=(*bones, *legs),
        flesh=(*flesh, *_seat(build), *leg_flesh),
        poses=poses,
        blend=blend,
        softness=0.05,
    )


def torso_and_head(build: Build, *, floor: float, ahead: float = 0.0) -> tuple[tuple[Bone, ...], tuple[Flesh, ...]]:
    """Return what lies above the hips, which are `floor` high and `ahead` along z: pelvis, spine, arms and head."""
    b, t = build, build.torso
    neck = floor + t
    width, depth = b.chest
    side = b.shoulder
    face = neck + 0.07 + 0.5 * b.head
    shoulder, elbow, wrist = _arm_joints(build, neck, ahead)
    spine = (
        Bone(name="pelvis", parent="", start=(0, floor + 0.12 * t, ahead), end=(0, floor, ahead)),
        Bone(name="waist", parent="pelvis", start=(0, floor + 0.22 * t, ahead), end=(0, floor + 0.45 * t, ahead)),
        Bone(name="chest", parent="waist", start=(0, floor + 0.45 * t, ahead), end=(0, neck - 0.05, ahead)),
        Bone(name="neck", parent="chest", start=(0, neck - 0.01, ahead - 0.02), end=(0, neck + 0.09, ahead + 0.005),
             radii=(0.053 * b.limb, 0.048 * b.limb)),
        Bone(name="head", parent="neck", start=(0, neck + 0.08, ahead), end=(0, face, ahead)),
        Bone(name="collar.L", parent="chest", start=(0.03, neck - 0.04, ahead - 0.01), end=shoulder),
        Bone(name="arm.L", parent="collar.L", start=shoulder, end=elbow, radii=(0.052 * b.limb, 0.041 * b.limb)),
        Bone(name="forearm.L", parent="arm.L", start=elbow, end=wrist, radii=(0.043 * b.limb, 0.027 * b.limb)),
    )  # fmt: skip
    hand_bone, hand = _hand(build, elbow, wrist)
    flesh: tuple[Flesh, ...] = (
        Ellipsoid(bone="waist", centre=(0, floor + 0.36 * t, ahead), radii=(b.waist[0], 0.28 * t, b.waist[1]),
                  blend=0.03),
        Ellipsoid(bone="waist", centre=(0, floor + 0.30 * t, ahead + 0.3 * b.waist[1]),
                  radii=(0.8 * b.waist[0], 0.24 * t, 0.7 * b.waist[1] + b.belly), blend=0.03),
        Ellipsoid(bone="chest", centre=(0, floor + 0.68 * t, ahead - 0.005), radii=(width, 0.34 * t, depth),
                  blend=0.03),
        Ellipsoid(bone="chest", centre=(0, floor + 0.80 * t, ahead - 0.02),
                  radii=(1.04 * width, 0.19 * t, 0.8 * depth), blend=0.025),
        Ellipsoid(bone="chest", centre=(0.48 * width, floor + 0.70 * t, ahead + 0.62 * depth),
                  radii=(0.48 * width, 0.13 * t, 0.34 * depth + b.bust), turn=(0, 12, 0),
                  blend=0.012),
        Ellipsoid(bone="chest", centre=(0.5 * side, neck - 0.02, ahead - 0.025), radii=(0.62 * side, 0.045, 0.055),
                  turn=(0, 0, -18), blend=0.025),
        Ellipsoid(bone="collar.L", centre=shoulder, radii=(0.066 * b.limb, 0.060 * b.limb, 0.060 * b.limb),
                  blend=0.025),
        Ellipsoid(bone="arm.L", centre=_between(shoulder, elbow, 0.55), radii=(0.09, 0.044 * b.limb, 0.05 * b.limb),
                  turn=(0, 0, -38)),
        Ellipsoid(bone="forearm.L", centre=_between(elbow, wrist, 0.25), radii=(0.07, 0.042 * b.limb, 0.045 * b.limb),
                  turn=(0, 0, -38)),
        *_head(build, face, ahead),
        *hand,
    )  # fmt: skip
    return (*spine, hand_bone), flesh


def _head(b: Build, face: float, z: float) -> tuple[Flesh, ...]:
    h = b.head / 0.23

    def lump(
        x: float, y: float, ahead: float, radii: Vector, *, turn: Vector = (0, 0, 0), blend: float = 0.006
    ) -> Flesh:
        half_axes = (radii[0] * h, radii[1] * h, radii[2] * h)
        return Ellipsoid(
            bone="head", centre=(x * h, face + y * h, z + ahead * h), radii=half_axes, turn=turn, blend=blend
        )

    return (
        lump(0, 0.035, -0.005, (0.076, 0.085, 0.096), blend=0.014),
        lump(0, -0.035, 0.035, (0.060, 0.085, 0.062), blend=0.014),
        lump(0, -0.098, 0.078, (0.024, 0.018, 0.022)),  # chin
        lump(0, -0.018, 0.098, (0.012, 0.030, 0.016), turn=(-14, 0, 0)),  # nose
        lump(0, -0.040, 0.102, (0.017, 0.010, 0.016)),
        lump(0, -0.069, 0.088, (0.025, 0.010, 0.016)),  # lips
        lump(0.032, 0.022, 0.080, (0.027, 0.010, 0.016)),  # brow
        lump(0.083, -0.005, -0.012, (0.010, 0.034, 0.022), turn=(-8, -25, 0)),  # ear
    )


def _arm_joints(b: Build, neck: float, z: float) -> tuple[Vector, Vector, Vector]:
    """Place shoulder, elbow and wrist, the arm hanging 38 degrees below the horizontal and bent a little forward."""
    down = np.radians(38.0)
    shoulder = np.array([b.shoulder, neck - 0.055, z - 0.015])
    elbow = shoulder + 0.53 * b.arm * np.array([np.cos(down), -np.sin(down), -0.04])
    wrist = elbow + 0.47 * b.arm * np.array([np.cos(down), -np.sin(down), 0.12])
    return _vector(shoulder), _vector(elbow), _vector(wrist)


def _hand(b: Build, elbow: Vector, wrist: Vector) -> tuple[Bone, tuple[Flesh, ...]]:
    """Return an open hand whose palm looks down: a palm, four fingers and a thumb."""
    size = b.arm / 0.56
    along = np.subtract(wrist, elbow)
    along /= np.linalg.norm(along)
    across = np.array([0.0, 0.0, 1.0]) - along[2] * along
    across /= np.linalg.norm(across)
    origin = np.array(wrist)

    def at(forward: float, sideways: float, up: float = 0.0) -> Vector:
        return _vector(origin + size * (forward * along + sideways * across + up * np.cross(across, along)))

    parts: list[Flesh] = [
        Ellipsoid(bone="hand.L", centre=at(0.055, 0.0), radii=(0.058 * size, 0.021 * size, 0.041 * size),
                  turn=(0, 0, -38), blend=0.007),
        Cone(bone="hand.L", start=at(-0.01, 0.0), end=at(0.04, 0.0), radii=(0.024 * size, 0.026 * size), blend=0.01),
        Cone(bone="hand.L", start=at(0.025, 0.03), end=at(0.055, 0.066, -0.008), radii=(0.019 * size, 0.014 * size),
             blend=0.006),
        Cone(bone="hand.L", start=at(0.055, 0.066, -0.008), end=at(0.09, 0.08, -0.012),
             radii=(0.014 * size, 0.011 * size), blend=0.006),
    ]  # fmt: skip
    for root, tip, length in (
        (0.034, 0.058, 0.078),
        (0.0125, 0.0205, 0.09),
        (-0.0095, -0.0165, 0.083),
        (-0.031, -0.054, 0.062),
    ):
        parts.append(
            Cone(
                bone="hand.L",
                start=at(0.085, root),
                end=at(0.1 + length, tip, -0.006),
                radii=(0.0115 * b.finger * size, 0.0098 * b.finger * size),
                blend=0.005,
            )
        )
    return Bone(name="hand.L", parent="forearm.L", start=wrist, end=at(0.1, 0.0)), tuple(parts)


def _seat(b: Build) -> tuple[Flesh, ...]:
    width, depth = b.seat
    y = b.leg + 0.05 * b.torso
    return (
        Ellipsoid(bone="pelvis", centre=(0, y + 0.02, 0), radii=(width, 0.22 * b.torso, depth), blend=0.025),
        Ellipsoid(bone="pelvis", centre=(0.48 * width, y - 0.05, -0.55 * depth),
                  radii=(0.52 * width, 0.16 * b.torso, 0.62 * depth)),
    )  # fmt: skip


def _legs(b: Build) -> tuple[tuple[Bone, ...], tuple[Flesh, ...]]:
    y, x, s = b.leg, b.hip, b.limb
    knee, ankle = (x + 0.025, 0.535 * y, 0.012), (x + 0.045, 0.095, -0.022)
    toes = (x + 0.065, 0.026, 0.135)
    bones = (
        Bone(name="thigh.L", parent="pelvis", start=(x, y, 0), end=knee, radii=(0.082 * s, 0.053 * s)),
        Bone(name="shin.L", parent="thigh.L", start=knee, end=ankle, radii=(0.051 * s, 0.034 * s)),
        Bone(name="foot.L", parent="shin.L", start=ankle, end=toes),
    )
    flesh: tuple[Flesh, ...] = (
        Ellipsoid(bone="thigh.L", centre=_between((x, y, 0.02), knee, 0.4), radii=(0.072 * s, 0.19 * y, 0.075 * s)),
        Ellipsoid(bone="shin.L", centre=_between(knee, ankle, 0.3, z=-0.028), radii=(0.046 * s, 0.12 * y, 0.043 * s)),
        Ellipsoid(bone="shin.L", centre=(knee[0], knee[1], knee[2] + 0.026), radii=(0.033 * s, 0.042, 0.028 * s)),
        Ellipsoid(bone="foot.L", centre=(ankle[0], 0.036, ankle[2] - 0.018), radii=(0.032, 0.038, 0.038)),
        Cone(bone="foot.L", start=(ankle[0], 0.075, ankle[2] + 0.01), end=toes, radii=(0.036, 0.024)),
        Ellipsoid(bone="foot.L", centre=(toes[0], 0.025, toes[2]), radii=(0.045, 0.023, 0.055), turn=(0, 8, 0)),
        Ellipsoid(bone="foot.L", centre=(toes[0] - 0.03, 0.022, toes[2] + 0.048), radii=(0.017, 0.017, 0.026)),
    )
    return bones, flesh


def _between(first: Vector, second: Vector, share: float, z: float = 0.0) -> Vector:
    return _vector((1 - share) * np.array(first) + share * np.array(second) + np.array([0, 0, z]))


def _vector(place: np.ndarray) -> Vector:
    x, y, z = (round(float(value), 6) for value in place)
    return (x, y, z)


ATHLETE = Build(
    leg=0.92, torso=0.53, arm=0.57, head=0.23, shoulder=0.195, hip=0.095, chest=(0.172, 0.118), waist=(0.132, 0.096),
    seat=(0.158, 0.108), limb=1.08, bust=0.004, belly=-0.004,
)  # fmt: skip
STOUT = Build(
    leg=0.82, torso=0.54, arm=0.53, head=0.235, shoulder=0.19, hip=0.11, chest=(0.19, 0.15), waist=(0.195, 0.155),
    seat=(0.19, 0.14), limb=1.28, bust=0.02, belly=0.05,
)  # fmt: skip
SLENDER = Build(
    leg=0.86, torso=0.47, arm=0.50, head=0.215, shoulder=0.16, hip=0.092, chest=(0.135, 0.096), waist=(0.105, 0.08),
    seat=(0.158, 0.105), limb=0.88, bust=0.03, belly=-0.004,
)  # fmt: skip
