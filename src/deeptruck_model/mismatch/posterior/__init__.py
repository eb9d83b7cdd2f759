"""The residual comes in; names go out, with their probabilities.

In between are candidate terms, their evidence, stepwise selection, and what no name explains.
"""
