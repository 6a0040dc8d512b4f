"""The machine language: construction trees, geometry, validity, edits, descriptions.

Pure Python and NumPy. Never imports an engine or a model, so a machine can be read, checked and
edited in well under a millisecond.
"""
