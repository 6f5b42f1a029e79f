"""Exports: read back by readers that we did not write."""
