"""How a match is found, and how sure we are of it."""
