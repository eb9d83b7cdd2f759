"""True J1939 between a controller and a truck, with a safety core between."""
