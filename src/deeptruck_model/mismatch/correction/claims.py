"""What is told of all that was found: what is strong, or holds along recordings that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from deeptruck_model.mismatch.correction.improvement import interval, joined
from deeptruck_model.mismatch.fit_result import Errors
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.rules import Rules


@dataclass(frozen=True)
class OwnCorrection:
    """Free runs of the simulator as given, and of the correction that holds all that was found, along the
    held-out recordings. `crossed`: along the others, each by a fit to others; None where they are few."""

    before: Errors
    after: Errors
    crossed: tuple[Errors, Errors] | None = None
    chosen: bool = False  # whether free runs along fitted recordings chose it among all corrections

    def helps(self, rules: Rules) -> bool:
        """Whether it is clearly better in what is held out, and was chosen or is surely better over all
        that it has not seen; true where nothing is long enough to tell."""
        if not len(self.before.speed):
            return True
        old, new = self.before, self.after
        if self.crossed is not None and self.crossed[0].speed.shape[1] == old.speed.shape[1]:
            old, new = (joined(both) for both in zip((old, new), self.crossed, strict=True))
        clearly = self.after.of_a_run() <= rules.no_better * self.before.of_a_run()
        return clearly and (self.chosen or interval(old, new)[0] > 0.0)


def claimed(x: Explanation, own: Callable[[], OwnCorrection], rules: Rules = Rules()) -> bool:
    """Whether what was found is told: it is strong, or its own correction helps, whatever drives best. What
    acts in windows of its own is shown by blocks of its own drives instead; what is slow by its size alone.
    Knots predict left-out blocks of slow noise too, so blocks claim nothing that is time-varying. Laws that
    overlap are each weak beside the others, and strong together."""
    if not x.causes or max(x.gained, *(c.gain for c in x.causes)) >= rules.clear:
        return True
    if any(c.needed is not None or _shown_in_windows(c) for c in x.causes):
        return True
    return own().helps(rules)


def _shown_in_windows(c: Cause) -> bool:
    windowed = c.term is not None and c.term.variant.acts_in_windows
    return windowed and c.left_out is not None and c.left_out.shown
