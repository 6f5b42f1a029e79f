"""The stages of the method, one folder each; their order is `tablemap.pipeline`."""
