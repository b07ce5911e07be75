"""Which is best, and who says so?"""
