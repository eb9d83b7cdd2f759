"""The examination of the mismatch tool, `deeptruck-model prove`: cases with hidden effects, and their scores.

`laws` are the textbook laws of the effects; `worlds` draws trucks, roads, drivers and sensors; `cases` makes
a case from a level and a seed; `tool` runs the tool as another process, and `scoring` opens the withheld
truth. `real` examines real logs. Nothing here imports the tool.
"""
