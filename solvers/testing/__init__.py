"""The public conformance kit: check a term, set, bridge, backend or formulation of your own, in any framework."""

from nonrigid.solvers.testing.backends import check_backend
from nonrigid.solvers.testing.bridges import check_bridge
from nonrigid.solvers.testing.errors import ConformanceError
from nonrigid.solvers.testing.examples import SetExample, TermExample, examples_of, model_classes
from nonrigid.solvers.testing.formulations import check_formulation
from nonrigid.solvers.testing.instances import Instance, instances
from nonrigid.solvers.testing.sets import check_set
from nonrigid.solvers.testing.terms import check_term

__all__ = [
    "ConformanceError",
    "Instance",
    "SetExample",
    "TermExample",
    "check_backend",
    "check_bridge",
    "check_formulation",
    "check_set",
    "check_term",
    "examples_of",
    "instances",
    "model_classes",
]
