"""Read the SHREC'16 partial-matching data from the folders null/, cuts/ and holes/."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from nonrigid.benchmark.datasets.archive import Archive
from nonrigid.benchmark.datasets.protocols import PairSpec
from nonrigid.geometry.errors import InputError, UnknownNameError

SPLITS = ("cuts", "holes")


@dataclass(frozen=True, kw_only=True)
class Shrec16:
    """List the pairs of the SHREC'16 track "Partial Matching of Deformable Shapes".

    The folder, or zip archive, holds `null/<class>.off` and, for each split, `<split>/<split>_<class>_shape_<n>` with
    the suffixes `.off`, `.baryc_gt` and `.baryc_gt_sym`. An optional table `source_poses.csv` (columns `shape`,
    `source_pose`) tells the TOSCA pose each part was cut from; pose 0 of a class is the full shape's own. The test set,
    which comes without full shapes and without truth, is opened by `nonrigid.benchmark.datasets.archive.open_dataset`.

    Parameters
    ----------
    root
        That folder or archive, or the folder in which it is called `shrec16`.
    splits
        Any of "cuts" and "holes".
    names
        Keep these shapes only, such as "cuts_cat_shape_12"; all of them where None.

    Raises
    ------
    UnknownNameError
        If a split or a shape is not there.
    InputError
        If the folder, or a file that belongs to a listed pair, is missing.

    Source: Cosmo, Rodola, Bronstein, Torsello, Cremers, Sahillioglu, "SHREC'16: Partial Matching of Deformable Shapes",
    Eurographics Workshop on 3D Object Retrieval 2016.
    """

    root: Path
    splits: tuple[str, ...] = SPLITS
    names: tuple[str, ...] | None = None

    @property
    def name(self) -> str:
        """Name of the data set and its splits."""
        return "shrec16 " + "+".join(self.splits)

    def pairs(self) -> Sequence[PairSpec]:
        """List the pairs by split, class and number, after checking that no file of a pair is missing."""
        for split in self.splits:
            if split not in SPLITS:
                raise UnknownNameError("split", split, SPLITS)
        root = Path(self.root)
        if not root.is_file():
            root = self._folder()
            for split in self.splits:
                if not (root / split).is_dir():
                    raise InputError(
                        f"there is no folder of the split {split!r}",
                        file=root / split,
                        remedy="drop this split or add it",
                    )
        return Archive(root=root, splits=self.splits, names=self.names).pairs()

    def _folder(self) -> Path:
        root = Path(self.root)
        for place in (root, root / "shrec16"):
            if (place / "null").is_dir():
                return place
        raise InputError(
            "neither this folder nor shrec16 in it holds a folder null",
            file=root,
            remedy="name the folder with null, cuts and holes",
        )
