"""Half a person on the trunk of a horse."""

from __future__ import annotations

from dataclasses import replace

from nonrigid.benchmark.datasets.anatomy import Anatomy, Bone, Cone, Ellipsoid, Flesh, Pose, Vector
from nonrigid.benchmark.datasets.people import ATHLETE, torso_and_head
from nonrigid.benchmark.datasets.quadrupeds import HORSE, trunk_and_legs

_SIZE = 1.22
"""What the horse, which is about one unit long, is enlarged by to carry a person measured in metres."""


def centaur(poses: tuple[Pose, ...]) -> Anatomy:
    """Return the anatomy of a centaur."""
    frame, _, tail = HORSE
    bones, flesh = trunk_and_legs(frame, tail)
    top, front = _SIZE * frame.shoulder[0] + 0.24, _SIZE * frame.shoulder[1] + 0.07
    upper_bones, upper_flesh = torso_and_head(replace(ATHLETE, finger=1.15), floor=top - 0.1, ahead=front)
    hip = Ellipsoid(
        bone="pelvis", centre=(0, top - 0.12, front - 0.03), radii=(0.145, 0.24, 0.13), turn=(-8, 0, 0), blend=0.03
    )
    return Anatomy(
        name="centaur",
        bones=(*map(_enlarged_bone, bones), replace(upper_bones[0], parent="withers"), *upper_bones[1:]),
        flesh=(*map(_enlarged, flesh), *upper_flesh, hip),
        poses=poses,
        blend=0.017,
        softness=0.07,
    )


def _enlarged_bone(bone: Bone) -> Bone:
    r0, r1 = bone.radii
    return replace(bone, start=_times(bone.start), end=_times(bone.end), radii=(_SIZE * r0, _SIZE * r1))


def _enlarged(flesh: Flesh) -> Flesh:
    blend = _SIZE * flesh.blend
    if isinstance(flesh, Cone):
        r0, r1 = flesh.radii
        return replace(
            flesh, start=_times(flesh.start), end=_times(flesh.end), radii=(_SIZE * r0, _SIZE * r1), blend=blend
        )
    return replace(flesh, centre=_times(flesh.centre), radii=_times(flesh.radii), blend=blend)


def _times(place: Vector) -> Vector:
    return (_SIZE * place[0], _SIZE * place[1], _SIZE * place[2])
