"""A model against the truth; the report's method as the baseline; suites and their tables."""
