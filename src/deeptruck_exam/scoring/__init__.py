"""Scores: the sealed truth against the verdict, held-out errors beside rivals, the pages people read."""
