"""Scores: the withheld truth against the verdict, held-out errors beside rivals, the pages people read."""
