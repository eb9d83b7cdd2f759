#!/usr/bin/env python3
"""Drive a truck over CAN: `deeptruck-vehicle`, as a script of the workspace."""

from deeptruck_nodes.start_vehicle import start

if __name__ == "__main__":
    start("start_vehicle")
