"""Opening a run: in the viewer, live, as a still, as a catalog."""
