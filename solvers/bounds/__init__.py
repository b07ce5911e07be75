"""Certificates: one module each, found by the name CERTIFICATE; `nonrigid.solvers.bounds.bound` asks them."""
