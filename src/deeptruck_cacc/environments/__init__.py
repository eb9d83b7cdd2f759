"""Environments: a simulated truck behind a leader.

Input: a simulator, a scene (leader, road, radar) and pedal commands. Output: observations, rewards and
traces.
"""
