"""A truck's controllers on a CAN bus, around a physics truck, for tests and for driving without a truck.

Commands come in as frames, what the sensors measure goes out. `python -m truck_bridge.emulator` runs it.
"""
