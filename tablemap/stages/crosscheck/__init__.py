"""Comparison of camera and laser, by the table's edges and legs."""

from tablemap.stages.crosscheck.effect import admitted_legs, corrected
from tablemap.stages.crosscheck.result import CrossCheck, Estimate
from tablemap.stages.crosscheck.stage import cross_check

__all__ = ["CrossCheck", "Estimate", "admitted_legs", "corrected", "cross_check"]
