"""A process that answers the questions of `live` for a node, so that the node is never blocked.

Questions and answers pass through its standard input and output; it ends when its input is closed, however
the node ended. Only the newest answer is kept. This module imports only the standard library, to keep the
node small.
"""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from threading import Thread
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from deeptruck_model.mismatch.live.questions import Question, Reply

NICE = 10  # whatever drives goes first


class Companion:
    """Client of the process: ask one question at a time; `taken` returns the answer when it is there.

    The process uses at most a `share` of a core on average: after each answer it pauses accordingly.
    """

    def __init__(self, share: float = math.inf) -> None:
        self._share, self._rests_until = share, -math.inf
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: Thread | None = None
        self._answer: Reply | None = None
        self._failed = ""

    @property
    def busy(self) -> bool:
        """Whether a question is being answered, an answer has not been taken, or the process pauses."""
        return self._thread is not None or time.monotonic() < self._rests_until

    def ask(self, question: Callable[[], Question]) -> None:
        """Start to answer the question that `question` returns when called in a thread; the first call starts
        the process."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "deeptruck_model.mismatch.live.companion"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C is for the node, which ends it
            )  # fmt: skip
        self._thread = Thread(target=self._talk, args=(self._process, question), daemon=True)
        self._thread.start()

    def _talk(self, process: subprocess.Popen[bytes], question: Callable[[], Question]) -> None:
        assert process.stdin is not None and process.stdout is not None
        try:
            pickle.dump(question(), process.stdin)
            process.stdin.flush()
            self._answer = pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            self._failed = f"the process that names has ended with {process.wait()}"

    def taken(self, *, waits: bool = False) -> Reply | None:
        """The answer, once; None if there is none yet, unless `waits`. Raises RuntimeError if the process has
        ended."""
        if self._thread is None or (self._thread.is_alive() and not waits):
            return None
        self._thread.join()
        self._thread, answer, self._answer = None, self._answer, None
        if answer is None:
            raise RuntimeError(self._failed)
        self._rests_until = time.monotonic() + answer.cpu_s / self._share
        return answer

    def close(self) -> None:
        """End the process immediately."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()


def main() -> None:
    """Answer questions until standard input is closed."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    os.nice(NICE)
    _serve(sys.stdin.buffer, out)


def _serve(questions: IO[bytes], answers: IO[bytes]) -> None:
    from deeptruck_model.mismatch.live.answer import answer

    while True:
        try:
            question = pickle.load(questions)
        except EOFError:
            return
        pickle.dump(answer(question), answers)
        answers.flush()


if __name__ == "__main__":
    main()
