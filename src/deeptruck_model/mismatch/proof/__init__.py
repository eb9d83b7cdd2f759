"""The proof: hidden effects, sealed cases and their scoring. Imports nothing of the tool it examines."""
