"""A simulated truck behind a leader.

In: a simulator, a scene (leader, road, radar) and pedal commands. Out: observations, rewards and traces.
"""
