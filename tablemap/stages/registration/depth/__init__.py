"""Registration from depth images alone, for recordings without a laser."""
