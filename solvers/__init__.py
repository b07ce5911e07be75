"""How a match is found, and how sure we are of it."""

from nonrigid.solvers.bounds.bound import bound
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import Match, match
from nonrigid.solvers.route import route
from nonrigid.solvers.solution import Bound, Solution
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status

__all__ = ["Bound", "Limits", "Match", "Solution", "Status", "bound", "match", "route", "solve"]
