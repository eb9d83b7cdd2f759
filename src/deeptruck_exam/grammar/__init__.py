"""Laws as data, for training and development: carrier x curve x memory x gate x size, drawn by seed.

The tool's own terms are carriers times curves too, so the grammar judges nothing: scores are of `laws`.
"""
