"""Answers to a node while driving: the probable mechanisms of the last minutes, and adaptation to the drive.

`answer` makes recordings of messages in memory, as of a bag, and compares them with the simulator as
`find_mismatch` does, without the correction; or it adapts the simulator, as `adapt` does. `companion.py` runs
it in a separate process.
"""

from __future__ import annotations

import time
from functools import lru_cache

from threadpoolctl import threadpool_limits

from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.mismatch.find import compared
from deeptruck_model.mismatch.live.adaptation import adapt, with_state
from deeptruck_model.mismatch.live.questions import DriveState, NamesReply, Question, Reply
from deeptruck_model.mismatch.mechanisms.families import ROOT, UNKNOWN
from deeptruck_model.mismatch.posterior.names import Compared, Node
from deeptruck_model.mismatch.report import lines
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.verdict.decide import name_tree
from deeptruck_model.mismatch.verdict.findings import findings
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.extract import of_messages
from deeptruck_model.simulators import Simulator, completed

NOTHING = Node("nothing", ROOT, 1.0)
NOT_DETECTED = "nothing that matters is detected"


def answer(question: Question) -> Reply:
    """Answer a question. Bad data become a refusal, not an exception."""
    begun = time.process_time()
    try:
        found, refused = _found(question), ""
    except InputError as error:
        found, refused = None, str(error)
    return Reply(found, refused, time.process_time() - begun)


def _found(question: Question) -> NamesReply | DriveState:
    simulator = _loaded(question.simulator, question.state)
    recordings = of_messages(
        "this drive",
        question.heard,
        simulator.interface,
        rate_hz=1.0 / simulator.dt,
        no_load=question.no_load,
    )
    with threadpool_limits(1):
        if not question.adapts:
            return name(simulator, recordings)
        return adapt(simulator, recordings, question.adapts, say=lambda step: None).own


@lru_cache(maxsize=2)
def _loaded(path: str, state: DriveState | None) -> Simulator:
    simulator = completed(simulators.load(path))
    return with_state(simulator, state) if state is not None and state.known else simulator


def name(simulator: Simulator, recordings: list[Recording], rules: Rules = Rules()) -> NamesReply:
    """Names and budget of recordings, all of which are fitted. Raises InputError as `find_mismatch` does."""
    c = compared(simulator, recordings, sets_aside=False, rules=rules)
    if not isinstance(c, Compared):
        return NamesReply(c.unusable_because or "")
    found = findings(c, None, None, c.budget.speed_rmse, rules.visible)
    stated = [f for f in found if f.stated != ROOT or f.effect == UNKNOWN]
    nodes = name_tree(c, None)
    if stated:
        says = " ".join(lines.cause(f) for f in stated)
    elif found:
        says = lines.candidates(nodes)
    else:
        says, nodes = NOT_DETECTED, (NOTHING,)
    return NamesReply(
        says.removesuffix("."),
        stated[0].stated if stated else ROOT,
        nodes,
        {p.part: p.share for p in c.budget.parts},
        c.budget.speed_rmse,
        c.budget.horizon_s,
    )
