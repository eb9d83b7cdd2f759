"""A truck's controllers on a CAN bus, around a physics truck, for tests and for driving without a truck.

They receive commands as frames and send the sensor signals. `python -m truck_bridge.emulator` runs it.
"""
