"""The method of the bachelor report, to compare with."""
