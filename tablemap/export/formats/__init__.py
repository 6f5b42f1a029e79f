"""The formats, a module each: whatever module stands here and has a ``FORMAT`` can be written.

Their heavy imports wait inside their functions, so that the list of formats costs nothing.
"""
