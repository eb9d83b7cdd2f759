"""The ROS 2 nodes: one process per node module, three start scripts, and modules that they share."""
