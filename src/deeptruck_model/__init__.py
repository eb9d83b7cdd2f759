"""Learn the longitudinal dynamics of a truck from its recordings, and find what the model leaves out."""
