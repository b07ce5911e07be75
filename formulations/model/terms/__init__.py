"""Terms: formulas that an objective is a sum of."""
