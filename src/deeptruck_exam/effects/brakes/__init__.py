"""Foundation brakes, their air and their heat; retarders the tool has no name for."""
