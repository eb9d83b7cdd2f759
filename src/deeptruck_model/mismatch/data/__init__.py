"""Recordings made fit to be compared with a simulator; samples that were set aside are counted by rule."""
