"""Trains the tool's effect classifier: laws of the grammar are added to drives with nothing missing.

In: seeds. Out: kernel evidence with the names of what was added, the network trained on it, and its card.
Only this package of the exam imports the tool, by its public names; it judges on `laws`.
"""
