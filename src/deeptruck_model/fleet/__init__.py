"""A fleet: recordings of many trucks read, compared, pooled and shown, each stage able to go on."""
