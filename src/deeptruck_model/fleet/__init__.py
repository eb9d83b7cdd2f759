"""One command for each of many trucks, on this machine or on a Ray cluster."""
