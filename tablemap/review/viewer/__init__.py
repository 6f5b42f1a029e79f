"""Ways to open a run: in the viewer, live, as a picture, in a catalog."""
