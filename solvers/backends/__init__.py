"""Backends: one module a library."""
