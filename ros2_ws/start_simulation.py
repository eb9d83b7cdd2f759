#!/usr/bin/env python3
"""Drive a simulated truck behind a leader: `deeptruck-simulation`, as a script of the workspace."""

from deeptruck_nodes.start_simulation import start

if __name__ == "__main__":
    start("start_simulation")
