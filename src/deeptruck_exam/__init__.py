"""What `deeptruck-model prove` examines the mismatch tool with: hidden effects, sealed cases, their scores.

In: levels, seeds and the families of effects to hide. Out: proof.md and scoreboard.json. `effects` are laws
by the part of the truck, `worlds` make trucks, roads, traffic, drivers and loggers, `sealed` is for the next
family; cases, run and score are beside this file. Nothing here imports the tool: it is another process.
"""
