"""FASTSim's truck, with one property concealed from the tool."""
