"""Makes a corrected simulator from an explanation, and measures its benefit on held-out drives."""
