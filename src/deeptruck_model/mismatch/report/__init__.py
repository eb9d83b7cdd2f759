"""The report: templates. It reads a verdict and decides nothing."""
