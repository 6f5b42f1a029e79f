"""The bachelor report's method, to compare with."""
