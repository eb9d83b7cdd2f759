"""The tool's recogniser of names, taught: every law of the families added to drives with nothing missing.

In: seeds. Out: fingerprints with the names of what was added, the network that learned from them, its card.
This room alone of the exam knows the tool, by its public face; it never sees the sealed family.
"""
