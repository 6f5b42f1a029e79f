"""A run's results apart from Rerun's own format, from which ``run.rrd`` can be drawn again."""
