"""The MCAP container: chunks, index, messages in order."""
