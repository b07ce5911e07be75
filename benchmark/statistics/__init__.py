"""Statistics that compare solvers and methods over many problems; a failure is an infinite cost."""
