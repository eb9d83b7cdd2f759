"""Registers the environment's name in gymnasium.

Importing deeptruck_cacc after gymnasium calls `register`, and so does
`gymnasium.make("deeptruck_cacc:deeptruck/Cacc-v0")`. Nothing else is loaded.
"""

from __future__ import annotations

NAME = "deeptruck/Cacc-v0"


def register() -> None:
    """Make `gymnasium.make(NAME)` find the environment."""
    from gymnasium.envs import registration

    if NAME not in registration.registry:
        registration.register(NAME, entry_point="deeptruck_cacc.environments.adapters:CaccGymEnv")
