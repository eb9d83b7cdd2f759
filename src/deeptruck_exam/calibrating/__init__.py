"""The calibrator of names, from drives with nothing missing and every law of the families added to them.

In: seeds. Out: fingerprints with the names of what was added, and the network that learned from them.
"""
