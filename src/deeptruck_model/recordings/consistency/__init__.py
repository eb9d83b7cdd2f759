"""Whether channels agree with one another: asked by suggest, import, train and mismatch alike."""
