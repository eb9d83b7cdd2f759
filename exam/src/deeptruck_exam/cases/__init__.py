"""Makes a case from a level and a seed: a driven truck, its recordings, a simulator, and the withheld
truth.
"""
