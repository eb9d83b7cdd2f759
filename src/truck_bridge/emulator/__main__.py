"""`python -m truck_bridge.emulator`."""

from truck_bridge.emulator.cli import main

if __name__ == "__main__":
    main()
