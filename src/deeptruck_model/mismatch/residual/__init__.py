"""Computes the residual of a simulator along prepared recordings, with its noise and the signals that may
explain it.
"""
