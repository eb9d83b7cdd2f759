"""Safety functions between a controller and the truck.

Input: observation and commands of a controller, and assumptions of the truck's capabilities. Output: commands
that keep the gap, also if signals fail. Also an adversarial search for violations.
"""
