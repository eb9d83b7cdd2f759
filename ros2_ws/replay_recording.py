#!/usr/bin/env python3
"""Play a bag back onto its topics: `deeptruck-replay`, as a script of the workspace."""

from deeptruck_nodes.replay_recording import start

if __name__ == "__main__":
    start("replay_recording")
