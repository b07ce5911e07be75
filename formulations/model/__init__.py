"""The modelling language: variables, terms, sets, problems. It knows neither meshes nor solvers."""

from nonrigid.formulations.model.gauge_sets import Body, ElasticNet, Simplex, Sphere
from nonrigid.formulations.model.problem import Objective, Problem, Sense, maximize, minimize
from nonrigid.formulations.model.sets import Box, Set, SmoothConstraint, free, nonnegative
from nonrigid.formulations.model.term import Applicable, Applied, Curvature, ModelError, Sum, Term
from nonrigid.formulations.model.terms.quadratic import QuadraticForm
from nonrigid.formulations.model.terms.smooth import Smooth
from nonrigid.formulations.model.variable import Membership, Variable

__all__ = [
    "Applicable",
    "Applied",
    "Body",
    "Box",
    "Curvature",
    "ElasticNet",
    "Membership",
    "ModelError",
    "Objective",
    "Problem",
    "QuadraticForm",
    "Sense",
    "Set",
    "Simplex",
    "Smooth",
    "SmoothConstraint",
    "Sphere",
    "Sum",
    "Term",
    "Variable",
    "free",
    "maximize",
    "minimize",
    "nonnegative",
]
