"""What a good match would be: methods stated as declarative optimization problems."""
