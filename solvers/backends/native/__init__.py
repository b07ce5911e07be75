"""Specialised dynamics: one module each."""
