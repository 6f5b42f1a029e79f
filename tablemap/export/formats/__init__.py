"""The formats, one module each: every module here with a ``FORMAT`` can be written.

Heavy imports are inside of functions, so that the list of formats loads quickly.
"""
