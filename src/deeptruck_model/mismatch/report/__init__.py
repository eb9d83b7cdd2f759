"""The report: templates that show a verdict and decide nothing."""
