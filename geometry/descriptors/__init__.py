"""What a surface looks like around a point, as a row of numbers."""
