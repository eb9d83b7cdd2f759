"""The numbers of `network`, compiled: one step, free runs, the loss of K-step sequences and its gradient."""
