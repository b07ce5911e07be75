"""Random forests: each vertex of the part is recognised by the heat near it, then the votes are smoothed spectrally."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from nonrigid.formulations.forest.forest import Forest
from nonrigid.formulations.forest.store import forest_digest, forest_files, load_forest, read_header
from nonrigid.formulations.forest.training import Example, ForestSettings, train_forest
from nonrigid.formulations.formulation import Correspondence, Pair, Stages
from nonrigid.formulations.functional_maps import estimated_rank, matched_rows
from nonrigid.formulations.model import Problem, Variable, free, minimize
from nonrigid.formulations.model.terms.squared_residual import SquaredResidual
from nonrigid.formulations.spectral_growth import map_fit
from nonrigid.geometry.arrays import FloatArray, IntArray
from nonrigid.geometry.errors import InputError

_TRAIN = "train one with `nonrigid train rf`"


@dataclass(frozen=True, kw_only=True)
class RandomForest:
    """Match densely by a forest trained on other poses of the same class, and by a functional map fitted to its votes.

    The forest gives every vertex p of the part a distribution P over labels, vertices of the whole. "low-pass":

        minimize over C, (k, r):  sum over p of m_p |C phi(p) - sum over l of P_pl psi(l)|^2,

    phi and psi the eigenfunctions of part and whole, m_p the area of p. Each vertex goes to the vertex of the whole
    whose row of eigenfunctions is nearest to C phi(p).

    Heat is the same on both sides of a symmetric body, so votes for left and right are nearly equal: their mean lies
    between. `orthonormal` adds a second problem, "map", the matrix with orthonormal columns nearest to C, which has to
    choose a side.

    Parameters
    ----------
    forest
        A forest, its file, or a folder of forests in which exactly one was trained for the full surface.
    digest
        Hash that the file must have, so that results name the forest they came from; any where empty. `held_out`
        fills it in.
    eigenfunctions
        k of the full surface; a surface with fewer vertices gives fewer.
    slanted
        Whether r is the number of eigenfunctions of the part below the last of the whole; else r = k, as published.
    orthonormal
        Whether to solve the second problem.
    low_pass
        Whether to smooth at all; else each vertex goes to the label with most votes.

    Source: Rodola, Rota Bulo, Windheuser, Vestner and Cremers, dense non-rigid shape correspondence using random
    forests (CVPR 2014); the variant with heat kernels and 90 eigenfunctions in Cosmo et al., SHREC'16.

    Examples
    --------
    >>> RandomForest(forest="cat.forest").eigenfunctions
    90
    """

    forest: str | Forest = ""
    digest: str = ""
    eigenfunctions: int = 90
    slanted: bool = True
    orthonormal: bool = True
    low_pass: bool = True

    method: ClassVar[str] = "rf"

    def stages(self, pair: Pair) -> Stages:
        """State the low-pass, and the orthonormal map if wanted; return one match a vertex of the part."""
        forest, vertices = self._for_surface(pair)
        votes = forest.votes(pair)
        every = np.arange(votes.shape[0])
        confidence = np.minimum(np.asarray(votes.max(axis=1).todense(), dtype=np.float64).ravel(), 1.0)
        if not self.low_pass:
            return Correspondence.between_vertices(pair, every, vertices[_most_voted(votes)], confidence)
        size = min(self.eigenfunctions, len(every) - 1, len(pair.full.mesh.vertices) - 1)
        if size < 1:
            raise InputError(f"eigenfunctions is {self.eigenfunctions}", remedy="give a number of at least 1")
        part = forest.spectrum(pair) if size <= len(forest.spectrum(pair).eigenvalues) else pair.part.spectrum(size)
        part, full = part.truncated(size), pair.full.spectrum(size)
        rank = max(1, estimated_rank(part.eigenvalues, full.eigenvalues)) if self.slanted else size
        rows = part.eigenfunctions[:, :rank]
        C = (yield low_pass(rows, votes @ full.eigenfunctions[vertices], part.mass))["C"]
        if self.orthonormal:
            C = (yield map_fit("map", C))["C"]
        return Correspondence.between_vertices(pair, every, matched_rows(C, rows, full.eigenfunctions), confidence)

    def held_out(self, class_name: str, source_pose: str | None) -> RandomForest:
        """Return the method with the one forest that may be tested on a part of this pose: it never saw the pose.

        Raises
        ------
        InputError
            If no forest is of the class, each was trained on the pose, or the pose is unknown.
        """
        if isinstance(self.forest, Forest):
            known = self.forest.class_name == class_name and source_pose not in (None, *self.forest.poses)
            if not known:
                raise InputError(
                    f"the forest of class {self.forest.class_name!r} learned from the poses {self.forest.poses}; "
                    f"it may not be tested on class {class_name!r}, pose {source_pose}",
                    remedy=_TRAIN,
                )
            return self
        files = self._files()
        heads = {file: read_header(file) for file in files}
        mine = [file for file in files if heads[file]["class_name"] == class_name]
        if not mine:
            raise InputError(f"no forest is of the class {class_name!r}", file=str(self.forest), remedy=_TRAIN)
        if source_pose is None:
            raise InputError(
                "the part's source pose is unknown, so the forest may have been trained on it",
                file=str(self.forest),
                remedy="add source_poses.csv to the data set",
            )
        unseen = [file for file in mine if source_pose not in heads[file]["poses"]]
        if not unseen:
            raise InputError(
                f"the forest was trained on the tested pose {source_pose}",
                file=mine[0],
                remedy="train one without it: `nonrigid train rf --folds 3`",
            )
        return replace(self, forest=str(unseen[0]), digest=forest_digest(unseen[0]))

    def trained_on(
        self,
        examples: Sequence[Example],
        *,
        class_name: str = "",
        seed: int = 0,
        settings: ForestSettings | None = None,
    ) -> RandomForest:
        """Return the method with a forest grown on these examples; see `train_forest`."""
        forest = train_forest(examples, class_name=class_name, settings=settings, seed=seed)
        return replace(self, forest=forest, digest="")

    def _files(self) -> list[Path]:
        assert isinstance(self.forest, str)
        if not self.forest:
            raise InputError("random forests need a trained forest", remedy=f"give forest=PATH; {_TRAIN}")
        files = forest_files(self.forest)
        if not files:
            raise InputError("this folder holds no .forest file", file=str(self.forest), remedy=_TRAIN)
        return files

    def _for_surface(self, pair: Pair) -> tuple[Forest, IntArray]:
        """Return the forest for the full surface, and the vertex of that surface that each label is."""
        if isinstance(self.forest, Forest):
            return self.forest, self.forest.template.label_vertices(pair.full)
        files = self._files()
        if self.digest and (found := forest_digest(files[0])) != self.digest:
            raise InputError(f"the forest has the hash {found}, not {self.digest}", file=files[0], remedy=_TRAIN)
        if len(files) == 1:
            forest = load_forest(files[0])
            return forest, forest.template.label_vertices(pair.full)
        forests = ((file.name, load_forest(file)) for file in files)
        matching = [(name, forest) for name, forest in forests if forest.template.fits(pair.full)]
        if len(matching) != 1:
            names = ", ".join(name for name, _ in matching) or "none"
            raise InputError(
                f"of {len(files)} forests, these were trained for {pair.full.mesh.name!r}: {names}",
                file=str(self.forest),
                remedy="name one file" if matching else _TRAIN,
            )
        forest = matching[0][1]
        return forest, forest.template.label_vertices(pair.full)


def low_pass(rows: FloatArray, images: FloatArray, mass: FloatArray) -> Problem:
    """Return min over C of the sum over p of m_p |C x_p - y_p|^2, in as few residuals as possible.

    With X = diag(sqrt(m)) rows = Q R and Y = diag(sqrt(m)) images the sum is ||C R' - Y'Q||_F^2 + |Y|^2 - |Y'Q|^2.

    Parameters
    ----------
    rows
        (n, r) eigenfunctions of the part.
    images
        (n, k) wanted rows: eigenfunctions of the whole, averaged over the votes.
    mass
        (n,) weights.

    Examples
    --------
    >>> print(low_pass(np.eye(3, 2), np.eye(3), np.ones(3)))
    low-pass: minimize SquaredResidual(C) + 1
      subject to C in Box(-inf, inf)
      with C of shape (3, 2)
    """
    weight = np.sqrt(mass)[:, None]
    Q, R = np.linalg.qr(weight * rows)
    Y = np.asarray(weight * images, dtype=np.float64)
    reachable = Y.T @ Q
    C = Variable("C", (images.shape[1], rows.shape[1]))
    fit = minimize(SquaredResidual(np.ascontiguousarray(R.T), reachable)(C))
    rest = max(float(np.sum(Y * Y) - np.sum(reachable * reachable)), 0.0)
    return Problem("low-pass", replace(fit, constant=rest), C @ free())


def _most_voted(votes: Any) -> IntArray:
    return np.asarray(votes.argmax(axis=1), dtype=np.int64).ravel()
