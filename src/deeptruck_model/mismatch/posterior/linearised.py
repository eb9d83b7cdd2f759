"""The search for names, about parameters of the simulator that are nearly right.

A truck is not linear in its parameters: brakes that are too strong in the simulator get too hot and fade. So
where parameters are far off they are set in the simulator, and all is linearised anew about them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.mechanisms import CandidateTerm, candidate_term
from deeptruck_model.mismatch.mechanisms.road import BOTH
from deeptruck_model.mismatch.posterior import nuisances
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.explain import explain, slow_beside
from deeptruck_model.mismatch.posterior.naming import recognised
from deeptruck_model.mismatch.posterior.rivals import force_of
from deeptruck_model.mismatch.posterior.road_lock import road_lock
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.stepwise import first_guess
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.residual.sensitivity import STEP
from deeptruck_model.simulators import Simulator

HALVINGS = 12


def accepted(simulator: Simulator, changes: Mapping[str, float], near: float = 0.0) -> dict[str, float]:
    """The relative changes, each halved until the simulator takes the value, and those `near` it on both
    sides (relative)."""
    return {name: _accepted(simulator, name, change, near) for name, change in changes.items()}


def _accepted(simulator: Simulator, name: str, change: float, near: float) -> float:
    own = simulator.parameters().get(name)
    if own is None:
        return change  # not its own; a force stands for it
    for _ in range(HALVINGS):
        try:
            for value in (own * (1.0 + change) * (1.0 + side) for side in (-near, near)):
                simulator.with_parameters({name: value})
        except InputError:
            change /= 2.0
        else:
            return change
    return 0.0


# Beyond this relative change parameters are set in the simulator, and all is linearised again; and once more.
RETUNE, SETTLED, STEPS = 0.05, 0.02, 5
CLOSE = 0.005  # where parameters are all that is fitted


def explained(
    simulator: Simulator,
    evidence: Evidence,
    prepared: Sequence[Prepared],
    held_out: Sequence[bool],
    seed: int,
    exclude: Sequence[str],
    say: Callable[[str], None],
) -> tuple[Evidence, Explanation]:
    """The explanation, and the evidence about whose parameters it was found."""
    say("searching for what is missing")
    evidence = evidence.to_fit()
    itself = nuisances.known(simulator, prepared[0].measured_acceleration, seed, evidence.rules)
    if itself is not None:
        say("learning the simulator's model discrepancy from the recordings it keeps")
        evidence = nuisances.allow_for(evidence, itself)
    elif not evidence.known_physics:
        evidence = nuisances.allow_for_the_unmeasured(evidence)
    around = _Around(simulator, tuple(prepared), tuple(held_out), seed, tuple(exclude), say)
    search = nuisances.beside_it(Search(evidence, exclude=exclude), exclude)
    search, found = _best_of(_starts(around, search))
    anew = around.parameters_of(search, found.model, RETUNE)
    if anew is None or not _better(
        search, found.model, anew, _again(found.model, anew), search.rules.least_gain
    ):
        return search.e.everywhere(), located_everywhere(search.e, recognised(search, found))
    # names moved the parameters where the first guess had not
    return anew.e.everywhere(), located_everywhere(anew.e, recognised(anew, explain(anew)))


def refitted(
    simulator: Simulator,
    evidence: Evidence,
    prepared: Sequence[Prepared],
    held_out: Sequence[bool],
    seed: int,
    free: frozenset[str],
    say: Callable[[str], None],
) -> tuple[Search, Model]:
    """The search about the parameters that fit best with no name, of which only `free` ones move; and that
    fit."""
    around = _Around(simulator, tuple(prepared), tuple(held_out), seed, (), say)
    search = Search(evidence)
    for _ in range(2 * STEPS):  # where mass and gains move together the way is long
        further = around.parameters_of(search, search.model((), free), CLOSE)
        if further is None:
            break
        search = further
    return search, search.model((), free)


def located_everywhere(e: Evidence, x: Explanation) -> Explanation:
    """The explanation, whose names and sizes the held-out recordings had no part in, with the forces that
    every recording has its own of fitted along these too: to be told where they act, and whether a road
    came again."""
    whole = e.everywhere()
    own = [c for c in x.causes if c.term is not None and _untold(e, c.term) and not _untold(whole, c.term)]
    slow = [c for c in x.causes if c.needed is not None]
    if not own + slow:
        return x
    search = Search(whole)
    model = search.model(x.model.named, x.model.free, x.model.fit)
    told = {id(c): replace(c, force=force_of(search, model, c.term)) for c in own if c.term is not None}
    if slow and (found := slow_beside(search, model, x.left_over)) is not None:
        told |= {id(c): replace(c, force=np.where(e.valid, c.force, found.force)) for c in slow}
    return replace(x, causes=tuple(_with_road(whole, told.get(id(c), c)) for c in x.causes))


def _with_road(whole: Evidence, c: Cause) -> Cause:
    """The cause with where its road came again, in the recordings that it was found in and in the others."""
    return replace(c, road=road_lock(whole, c.force)) if c.effect in BOTH or c.needed is not None else c


def _untold(e: Evidence, term: CandidateTerm) -> bool:
    """Whether a column of a term acts nowhere in these rows."""
    return bool((np.abs(term.columns[e.valid]).max(axis=0, initial=0.0) < 1e-9).any())


@dataclass(frozen=True)
class _Around:
    """Makes searches about other parameters of the simulator."""

    simulator: Simulator
    prepared: tuple[Prepared, ...]
    held_out: tuple[bool, ...]
    seed: int
    exclude: tuple[str, ...]
    say: Callable[[str], None]

    def parameters_of(self, search: Search, model: Model, least: float) -> Search | None:
        """The search about the parameters a model asks for; None where none changes by more than `least`."""
        own = self.simulator.parameters()
        change = {p: model.moved(p) for p in search.parameters if p in own}
        if all(abs(c) <= least for c in change.values()):
            return None
        self.say("searching around the refitted parameters")
        total = {p: search.e.total_change(p, c) for p, c in change.items()}
        possible = {
            p: float(np.clip(c, *search.e.vehicle.possible(p))) for p, c in total.items() if abs(c) > 0.005
        }
        moved = accepted(self.simulator, possible, near=STEP)
        tuned = self.simulator.with_parameters({p: own[p] * (1 + c) for p, c in moved.items()})
        mass_kg = search.e.mass if search.e.mass_known else None
        e = gather(
            tuned,
            self.prepared,
            self.held_out,
            seed=self.seed,
            moved=moved,
            rules=search.rules,
            mass_kg=mass_kg,
        )
        return nuisances.beside_it(Search(e.to_fit(), exclude=self.exclude), self.exclude)


def _starts(around: _Around, search: Search) -> list[Search]:
    """Searches about the parameters as given, as moved by the first guess; and about those that do best
    alone, where these explain more than the best one name: it may stand for what the simulator is not linear
    in about parameters far off, and they may stand for it."""
    starts = [_followed(around, search, first_guess)]
    alone = _followed(around, search, _alone)
    if alone is not search and _better(search, first_guess(search), alone, _alone(alone), 0.0):
        starts.append(_followed(around, alone, first_guess))
    return starts


def _best_of(starts: Sequence[Search]) -> tuple[Search, Explanation]:
    """The search whose explanation is the best, whichever parameters it began about; and that."""
    best = starts[0], explain(starts[0])
    for search in starts[1:]:
        found = explain(search)
        if _better(best[0], best[1].model, search, found.model, 0.0):
            best = search, found
    return best


def _followed(around: _Around, search: Search, guess: Callable[[Search], Model]) -> Search:
    """The search about the parameters of a guess, and on from the guess there, until they have settled; as it
    was where the first step explains no more.

    Further steps are not weighed against each other: where mass and gains move together every step gains
    little, though the way is long.
    """
    here = guess(search)
    moved = around.parameters_of(search, here, RETUNE)
    if moved is None:
        return search
    there = _again(here, moved)  # a name in its form shows as well as a new guess how far to go
    if not _better(search, here, moved, there, search.rules.least_gain):
        return search
    for _ in range(STEPS):
        further = around.parameters_of(moved, there, SETTLED)
        if further is None:
            break
        moved, there = further, _again(there, further)
    return moved


def _alone(search: Search) -> Model:
    return search.background(())


def _better(given: Search, guess: Model, anew: Search, moved: Model, by: float) -> bool:
    """Whether the search around the moved parameters explains more of what both may use, `by` nats.

    Parameters can make up for a force they have nothing to do with, if they are moved far enough; and mass,
    gains and drag all scaled alike change next to nothing.
    """
    both = given.e.valid & anew.e.valid
    doubt = np.maximum(given.e.disagreement, anew.e.disagreement)  # rows weigh alike in both
    sigma = max(given.sigma, anew.sigma)
    scores = [
        Search(replace(s.e, disagreement=doubt), only=both, sigma=sigma).model(m.named, m.free).score
        for s, m in ((given, guess), (anew, moved))
    ]
    return bool(scores[1] > scores[0] + by)


def _again(model: Model, search: Search) -> Model:
    """A model with the same names in the same forms, on other evidence."""
    return search.background(tuple(_on(search.e, s) for s in model.named))


def _on(e: Evidence, s: CandidateTerm) -> CandidateTerm:
    made = candidate_term(s.mechanism, s.variant, e)
    return replace(s, parts=made.parts, columns=made.columns)
