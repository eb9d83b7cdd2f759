"""Registers the environment's name in gymnasium.

gymnasium calls `register`, an entry point of the installed package, when it is imported. Nothing else is
loaded.
"""

from __future__ import annotations

NAME = "deeptruck/Cacc-v0"


def register() -> None:
    """Make `gymnasium.make(NAME)` and `gymnasium.make_vec(NAME, ...)` find the environment."""
    from gymnasium.envs import registration

    if NAME not in registration.registry:
        registration.register(
            NAME,
            entry_point="deeptruck_cacc.environments.adapters:CaccGymEnv",
            vector_entry_point="deeptruck_cacc.environments.adapters:CaccVectorEnv",
        )
