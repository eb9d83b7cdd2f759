"""The nodes: each module named after a node is one process; the rest is what they share."""
