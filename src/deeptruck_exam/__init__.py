"""What `deeptruck-model prove` examines the mismatch tool with: cases with a hidden law, and their scores.

`laws` are the textbook laws of the score; `worlds` draws trucks, roads, drivers and sensors; `cases` makes a
case of a level and a seed; `tool` runs the tool as another process, and `scoring` opens the withheld truth.
`real` examines real logs. Nothing here imports the tool.
"""
