"""How the creatures stand, walk, sit and look.

All angles are degrees of a rotation vector in the frame of the neutral pose, x to the creature's left, y up, z ahead. A
positive turn about x bends what stands up forwards, and swings what hangs down backwards.
"""

from __future__ import annotations

from nonrigid.benchmark.datasets.anatomy import Pose

PEOPLE: tuple[Pose, ...] = (
    {  # walking
        "thigh.L": (-28, 0, 0), "shin.L": (12, 0, 0), "foot.L": (-8, 0, 0), "thigh.R": (18, 0, 0), "shin.R": (26, 0, 0),
        "foot.R": (18, 0, 0), "arm.L": (26, 0, -22), "forearm.L": (-14, -10, 0), "arm.R": (-22, 0, 22),
        "forearm.R": (-24, 10, 0),
        "waist": (2, -6, 0), "chest": (3, -6, 0), "head": (0, 10, 0),
    },
    {  # running
        "thigh.L": (-56, 0, 0), "shin.L": (70, 0, 0), "foot.L": (10, 0, 0), "thigh.R": (26, 0, 0), "shin.R": (38, 0, 0),
        "foot.R": (26, 0, 0), "arm.L": (34, 0, -24), "forearm.L": (-50, -34, 0), "arm.R": (-38, 0, 24),
        "forearm.R": (-62, 34, 0),
        "waist": (8, -8, 0), "chest": (8, -8, 0), "neck": (-8, 6, 0), "head": (-6, 6, 0),
    },
    {  # waving
        "collar.L": (0, 0, 14), "arm.L": (0, -8, 40), "forearm.L": (0, -20, 44), "hand.L": (0, 0, 12),
        "collar.R": (0, 0, 4),
        "arm.R": (6, 0, 26), "forearm.R": (-14, 0, 0), "waist": (0, 0, -5), "chest": (0, 0, -7), "neck": (0, 0, 8),
        "head": (0, 16, 0), "thigh.R": (0, 0, -7), "thigh.L": (0, 0, 5),
    },
    {  # sitting on a stool
        "thigh.L": (-74, 0, 6), "shin.L": (76, 0, 0), "thigh.R": (-78, 0, -8), "shin.R": (66, 0, 0), "waist": (6, 0, 0),
        "chest": (10, 0, 0), "neck": (6, 0, 0), "head": (4, -20, 0), "arm.L": (-22, 0, -14), "forearm.L": (-34, -26, 0),
        "arm.R": (-14, 0, 16), "forearm.R": (-36, 22, 0),
    },
    {  # stretching both arms up
        "collar.L": (0, 0, 20), "arm.L": (0, 0, 74), "forearm.L": (0, 0, 20), "collar.R": (0, 0, -20),
        "arm.R": (0, 0, -64),
        "forearm.R": (0, 0, -30), "waist": (-6, 0, 3), "chest": (-8, 0, 4), "neck": (-10, 0, 0), "head": (-10, 0, 0),
        "thigh.L": (0, 0, 7), "thigh.R": (0, 0, -7),
    },
    {  # bending down to pick something up
        "pelvis": (34, 0, 0), "thigh.L": (-52, 0, 4), "shin.L": (30, 0, 0), "thigh.R": (-44, 0, -4),
        "shin.R": (22, 0, 0),
        "waist": (24, 4, 0), "chest": (20, 6, 0), "neck": (-10, 0, 0), "head": (-14, 0, 0), "arm.L": (-44, 0, -18),
        "forearm.L": (-10, -10, 0), "arm.R": (-30, 0, 16), "forearm.R": (-20, 8, 0),
    },
    {  # throwing
        "pelvis": (0, -16, 0), "thigh.L": (-34, 6, 6), "shin.L": (20, 0, 0), "thigh.R": (22, 0, -10),
        "shin.R": (16, 0, 0),
        "waist": (-4, -14, 0), "chest": (-6, -16, -4), "neck": (0, 14, 0), "head": (0, 20, 0), "collar.R": (0, -8, -10),
        "arm.R": (0, -24, -44), "forearm.R": (0, 24, -62), "arm.L": (0, -50, 30), "forearm.L": (0, -12, 0),
    },
    {  # squatting
        "pelvis": (16, 0, 0), "thigh.L": (-98, 0, 18), "shin.L": (98, 0, 0), "foot.L": (-14, 0, 0),
        "thigh.R": (-92, 0, -18),
        "shin.R": (92, 0, 0), "foot.R": (-14, 0, 0), "waist": (16, 0, 0), "chest": (12, 0, 0), "neck": (-14, 0, 0),
        "head": (-16, 12, 0), "arm.L": (0, -58, 26), "forearm.L": (0, -20, 0), "arm.R": (0, 50, -22),
        "forearm.R": (0, 34, 0),
    },
)  # fmt: skip

_WALKING: Pose = {
    "foreleg.L": (-20, 0, 0), "foreshank.L": (6, 0, 0), "forefoot.L": (6, 0, 0), "foreleg.R": (18, 0, 0),
    "foreshank.R": (-2, 0, 0), "forefoot.R": (16, 0, 0), "thigh.L": (18, 0, 0), "shin.L": (-4, 0, 0),
    "hindfoot.L": (8, 0, 0), "thigh.R": (-18, 0, 0), "shin.R": (14, 0, 0), "hindfoot.R": (-6, 0, 0),
    "neck1": (4, 4, 0), "head": (-4, 4, 0), "tail1": (8, 8, 0), "tail2": (4, 8, 0), "rump": (0, 4, 0),
}  # fmt: skip
_TROTTING: Pose = {
    "foreleg.L": (-34, 0, 0), "foreshank.L": (-18, 0, 0), "forefoot.L": (52, 0, 0), "foreleg.R": (24, 0, 0),
    "forefoot.R": (12, 0, 0), "thigh.L": (24, 0, 0), "shin.L": (-8, 0, 0), "hindfoot.L": (18, 0, 0),
    "thigh.R": (-32, 0, 0), "shin.R": (28, 0, 0), "hindfoot.R": (-24, 0, 0), "neck1": (-8, 0, 0), "neck2": (-4, 0, 0),
    "head": (6, 0, 0), "tail1": (20, -6, 0), "tail2": (12, -8, 0), "withers": (0, -4, 0), "rump": (0, 4, 0),
}  # fmt: skip
_EXTENDED: Pose = {  # galloping, in the air
    "withers": (-8, 0, 0), "rump": (8, 0, 0), "foreleg.L": (-36, 0, 0), "foreshank.L": (-10, 0, 0),
    "forefoot.L": (10, 0, 0),
    "foreleg.R": (-26, 0, 0), "foreshank.R": (-6, 0, 0), "forefoot.R": (24, 0, 0), "thigh.L": (32, 0, 0),
    "shin.L": (-16, 0, 0), "hindfoot.L": (20, 0, 0), "thigh.R": (24, 0, 0), "shin.R": (-10, 0, 0),
    "hindfoot.R": (26, 0, 0),
    "neck1": (14, 0, 0), "neck2": (6, 0, 0), "head": (-10, 0, 0), "tail1": (30, 0, 0), "tail2": (18, 0, 0),
}  # fmt: skip
_LOOKING_BACK: Pose = {
    "withers": (0, 12, 0), "neck1": (4, 32, 0), "neck2": (0, 34, 0), "head": (6, 22, 6), "tail1": (12, -24, 0),
    "tail2": (10, -26, 0), "tail3": (0, -20, 0), "rump": (0, -6, 0), "foreleg.R": (-12, 0, 0), "foreshank.R": (8, 0, 0),
    "thigh.L": (-10, 0, 0), "shin.L": (8, 0, 0),
}  # fmt: skip
_NOSE_TO_THE_GROUND: Pose = {
    "withers": (8, 0, 0), "neck1": (44, -6, 0), "neck2": (26, -6, 0), "head": (2, -8, 0), "foreleg.L": (-22, 0, 0),
    "foreshank.L": (6, 0, 0), "foreleg.R": (4, 0, 0), "forefoot.R": (6, 0, 0), "thigh.R": (14, 0, 0),
    "shin.R": (-8, 0, 0),
    "tail1": (-8, 6, 0), "tail2": (-10, 10, 0),
}  # fmt: skip
_SITTING: Pose = {
    "loin": (-34, 0, 0), "withers": (-6, 0, 0), "rump": (-10, 0, 0), "foreleg.L": (34, 0, 0), "foreleg.R": (30, 0, 0),
    "forefoot.L": (4, 0, 0), "forefoot.R": (6, 0, 0), "thigh.L": (-34, 0, 8), "shin.L": (70, 0, 0),
    "hindfoot.L": (-68, 0, 0),
    "thigh.R": (-38, 0, -8), "shin.R": (72, 0, 0), "hindfoot.R": (-66, 0, 0), "neck1": (14, 6, 0), "neck2": (8, 8, 0),
    "head": (12, 8, 0), "tail1": (34, 12, 0), "tail2": (20, 20, 0),
}  # fmt: skip
_BOWING: Pose = {  # stretching, breast to the ground
    "loin": (14, 0, 0), "withers": (18, 0, 0), "foreleg.L": (-54, 0, 0), "foreshank.L": (-6, 0, 0),
    "forefoot.L": (4, 0, 0),
    "foreleg.R": (-46, 0, 0), "foreshank.R": (-10, 0, 0), "forefoot.R": (6, 0, 0), "thigh.L": (-12, 0, 0),
    "shin.L": (-4, 0, 0),
    "thigh.R": (-20, 0, 0), "shin.R": (6, 0, 0), "neck1": (-24, 0, 0), "neck2": (-16, 0, 0), "head": (-4, 10, 0),
    "tail1": (26, 0, 0), "tail2": (18, 12, 0), "tail3": (10, 12, 0),
}  # fmt: skip
_HEAD_HIGH: Pose = {  # howling, or neighing
    "withers": (-4, 0, 0), "neck1": (-22, 0, 0), "neck2": (-22, -4, 0), "head": (-18, 0, 0), "foreleg.L": (10, 0, 0),
    "foreleg.R": (-8, 0, 0), "thigh.L": (12, 0, 0), "shin.L": (-6, 0, 0), "thigh.R": (-8, 0, 0), "shin.R": (6, 0, 0),
    "tail1": (-14, 0, 0), "tail2": (-10, 0, 0),
}  # fmt: skip
_REARING: Pose = {
    "loin": (-38, 0, 0), "withers": (-8, 0, 0), "thigh.L": (22, 0, 0), "shin.L": (16, 0, 0), "hindfoot.L": (-6, 0, 0),
    "thigh.R": (32, 0, 0), "shin.R": (6, 0, 0), "hindfoot.R": (-4, 0, 0), "foreleg.L": (-34, 0, 0),
    "foreshank.L": (-24, 0, 0),
    "forefoot.L": (78, 0, 0), "foreleg.R": (-14, 0, 0), "foreshank.R": (-30, 0, 0), "forefoot.R": (60, 0, 0),
    "neck1": (14, 0, 0), "neck2": (10, 0, 0), "head": (14, 0, 0), "tail1": (24, 0, 0), "tail2": (14, 0, 0),
}  # fmt: skip
_KICKING: Pose = {  # both hind legs thrown out
    "loin": (20, 0, 0), "rump": (6, 0, 0), "thigh.L": (36, 0, 0), "shin.L": (-22, 0, 0), "hindfoot.L": (30, 0, 0),
    "thigh.R": (32, 0, 0), "shin.R": (-8, 0, 0), "hindfoot.R": (24, 0, 0), "foreleg.L": (-24, 0, 0),
    "foreleg.R": (-16, 0, 0),
    "neck1": (14, 8, 0), "neck2": (10, 0, 0), "tail1": (44, 0, 0), "tail2": (20, 10, 0),
}  # fmt: skip

PREDATORS = (
    _WALKING, _TROTTING, _EXTENDED, _LOOKING_BACK, _NOSE_TO_THE_GROUND, _SITTING, _BOWING, _HEAD_HIGH,
)  # fmt: skip
HORSES = (
    _WALKING, _TROTTING, _EXTENDED, _LOOKING_BACK, _NOSE_TO_THE_GROUND, _REARING, _KICKING, _HEAD_HIGH,
)  # fmt: skip

_ARMS = ("waist", "chest", "neck", "head", "collar", "arm", "forearm", "hand")
_NECK = ("neck1", "neck2", "head")


def _without(pose: Pose, bones: tuple[str, ...]) -> Pose:
    return {bone: turn for bone, turn in pose.items() if bone.split(".")[0] not in bones}


def _only(pose: Pose, bones: tuple[str, ...]) -> Pose:
    return {bone: turn for bone, turn in pose.items() if bone.split(".")[0] in bones}


CENTAURS = tuple(
    {**_without(horse, _NECK), **_only(PEOPLE[number], _ARMS)}
    for horse, number in zip(HORSES, (0, 1, 6, 2, 4, 3, 5, 7), strict=True)
)
