"""The console script without a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from deeptruck_core.terminal import progress
from deeptruck_model import cli


@pytest.fixture
def script(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """script(words) -> (exit code, output, errors) of `deeptruck-model`, without progress, which a busy
    machine would show."""
    monkeypatch.setattr(progress, "QUIET_S", 1e5)

    def _script(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["deeptruck-model", *map(str, words)])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        return (int(caught.value.code or 0), *capsys.readouterr())

    return _script
