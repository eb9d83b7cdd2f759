"""From the residual to the probabilities of names: candidate terms, kernels, and the sampler of the
posterior.
"""
