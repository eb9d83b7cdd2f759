"""Simulators by other authors: found and made (`reference`), used (`truck`), stored (`saved`).

`python:MODULE:FACTORY[:ARGUMENTS.yaml]` or `fmu:MODEL.fmu[:MAPPING.yaml]` becomes a `simulators.Simulator`.
This package imports no other heavy part of deeptruck, because commands check such a simulator first.
"""
