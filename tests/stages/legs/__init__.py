"""Legs: scans and depth of scenes whose truth is known."""
