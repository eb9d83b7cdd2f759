"""An explanation comes in; a corrected simulator goes out.

With it goes what it is worth on drives it was not fitted to.
"""
