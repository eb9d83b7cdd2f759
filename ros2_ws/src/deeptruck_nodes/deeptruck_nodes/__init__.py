"""The nodes: each module named after a node is one process. Three start them; the rest is what they share."""
