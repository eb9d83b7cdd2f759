"""The live page of a run, without ROS: converts messages to events for browsers.

`live` turns messages into batches, `server` sends them to browsers on this machine, `place` is the address.
"""
