"""Tests of the fitted top."""
