"""Bridges: one module a reformulation."""
