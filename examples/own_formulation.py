"""A formulation of your own: spectral matching, Leordeanu and Hebert (ICCV 2005), on a built-in pair."""

from dataclasses import dataclass

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.protocol import score
from nonrigid.formulations.candidates import candidate_matches
from nonrigid.formulations.distortion import consistency
from nonrigid.formulations.formulation import Correspondence, Pair
from nonrigid.formulations.model import Problem, QuadraticForm, Sphere, Variable, maximize
from nonrigid.solvers.match import match


@dataclass(frozen=True, kw_only=True)
class SpectralMatching:  # noqa: D101
    samples: int = 60

    def stages(self, pair):  # noqa: D102
        matches = candidate_matches(pair, part_samples=self.samples, full_samples=300, per_sample=5)
        u = Variable("u", len(matches))
        solution = yield Problem("spectral", maximize(QuadraticForm(consistency(pair, matches))(u)), u @ Sphere())
        kept = matches.greedy(solution["u"], floor=0.05)
        return Correspondence.between_vertices(pair, matches.part[kept], matches.full[kept])


data = Creatures(vertices=1000).pairs()[0].load()
found = match(Pair.of(data.part, data.full), SpectralMatching(), backend="nlopt:LD_CCSAQ")
print(found.solutions[0], score(data, found.correspondence.dense(len(data.part.vertices))).mean_error, sep="\n")
