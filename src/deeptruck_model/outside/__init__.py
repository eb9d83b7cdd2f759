"""Simulators that somebody else wrote: found and made (`reference`), used (`truck`), kept (`saved`).

In comes `python:MODULE:FACTORY[:ARGUMENTS.yaml]` or `fmu:MODEL.fmu[:MAPPING.yaml]`, out comes a
`simulators.Simulator`. It is part of the floor: a command looks at such a simulator before anything heavy of
ours is imported.
"""
