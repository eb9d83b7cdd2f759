"""What stands between a controller and the truck.

In: observation and commands of a controller, and a promise of what the truck can do. Out: commands that keep
the gap, also where signals fail; and the search that tries to break it.
"""
