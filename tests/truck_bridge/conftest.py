from __future__ import annotations

import sys
from pathlib import Path

import pytest

from truck_bridge import vehicles

sys.path.append(str(Path(__file__).parent))  # bridge_world.py stands beside the tests

from bridge_world import SIGNED, World


@pytest.fixture
def world(request):
    made = []

    def make(name, **options):
        made.append(World(name, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture(params=[*vehicles.NAMES, SIGNED], ids=[*vehicles.NAMES, "signed_truck"])
def name(request):
    return request.param
