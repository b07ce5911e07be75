"""Say which method and which solver is best, and who says so."""
