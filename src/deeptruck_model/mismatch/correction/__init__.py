"""From an explanation to a corrected simulator, with its benefit on drives it was not fitted to."""
