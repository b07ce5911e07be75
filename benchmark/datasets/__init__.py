"""Data sets of partial-matching pairs."""
