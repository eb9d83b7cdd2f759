"""Recordings come in; recordings fit to be compared with a simulator go out.

What was set aside is counted by rule. Nothing here knows of mechanisms.
"""
