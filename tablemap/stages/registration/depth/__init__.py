"""Registration where only the depth images do."""
