"""Comparison of models with the truth, suites of scenarios, and tables of their scores."""
