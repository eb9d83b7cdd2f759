"""A simulator and prepared recordings come in; the residual goes out.

With it go its noise and the signals that may explain it.
"""
