"""The live page of a run: what the nodes say comes in, one page in a browser goes out. No ROS in here.

`live` turns messages into batches, `server` hands them to browsers on this machine, `place` is the address.
"""
