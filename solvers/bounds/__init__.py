"""Certificates: one module each."""
