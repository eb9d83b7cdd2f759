"""Cases: a level and a seed become a driven truck, its recordings, a simulator, and the withheld truth."""
