"""Benchmarks: each names what it is compared with, and both run in the same session."""
