"""Tests of crosscheck."""
