"""Fleet analysis: extracts, compares and pools recordings of many trucks, in stages that can be resumed."""
