"""Mutants of the safety core that change nothing a truck could notice, with the reason of each."""

from __future__ import annotations

# Survivors that are alike to the original: module, the changed line, what it becomes.
_STEP = "step = abs(motion.value - axis.rest) > axis.limits.rate * motion.elapsed(now) + axis.demand.scale"
_IDLE = "idle = axis.idle_at_rest and abs(demand - axis.rest) < axis.demand.scale / 2"
ALIKE: set[tuple[str, str, str]] = {
    (module, before, before.replace(old, new, 1))
    for module, before, old, new in (
        # where two results of floating-point sums are compared, equality decides nothing
        ("motion", "if abs(move) > rate * elapsed + quantum:", ">", ">="),
        ("motion", "inside = low + quantum < value < high - quantum", "<", "<="),
        ("motion", "inside = low + quantum < value < high - quantum", "value <", "value <="),
        (
            "motion",
            "return 'jerk' if inside and bend > self.axis.limits.jerk * elapsed ** 2 + quantum else ''",
            ">",
            ">=",
        ),
        ("motion", "away = abs(value - rest) > abs(self.value - rest) + quantum", ">", ">="),
        (
            "motion",
            "return away or abs(value - self.value) > self.axis.limits.fade * self.elapsed(now) + quantum",
            ">",
            ">=",
        ),
        ("motion", "near = abs(self._planned - self.value) <= 0.51 * self.axis.demand.scale", "<=", "<"),
        ("hearing", "if arrivals.count * heard.period_s <= TOO_OFTEN:", "<=", "<"),
        ("core", "return 'too early' if now - motion.time < 0.5 * axis.period_s else ''", "<", "<="),
        ("core", _STEP, ">", ">="),
        ("core", _IDLE, "<", "<="),
        # no speed on the wire, in 1/256 km/h, is exactly 0.1 m/s
        ("core", "self._moves = self._speed >= STANDS_M_S", ">=", ">"),
        # no axis of our vehicles has a rest other than 0 (motion.py is tested with one that has)
        ("core", _STEP, "motion.value - axis.rest", "motion.value + axis.rest"),
        ("core", _IDLE, "demand - axis.rest", "demand + axis.rest"),
        # a value that arming, engaging or the first command sets before it is used
        ("core", "self._commanded = -math.inf", "self._commanded = -math.inf", "pass"),
        ("core", "self._commanded = -math.inf", "-math", "math"),
        ("core", "self._now = self._engaged_at = self._faded_at = -math.inf", "-math", "math"),
        # a signal that never came has no value, and the first one begins its time
        ("hearing", "NEVER = (math.nan, -math.inf, -math.inf)", "-math.inf)", "math.inf)"),
        # the first arrival of all sets it
        ("hearing", "count: int = 0", "0", "1"),
        # both branches agree where they meet
        ("motion", "if x <= x1:", "<=", "<"),
        # a speed that every engagement sets before it is used
        ("motion", "self.start(axis.rest, 0.0, -math.inf)", "0.0", "1.0"),
        # one byte more than the number fills
        (
            "checks",
            "total = sum(word.to_bytes(8, 'little')[:7]) + counter + sum(can_id.to_bytes(4, 'big'))",
            "(8",
            "(9",
        ),
        (
            "checks",
            "total = sum(word.to_bytes(8, 'little')[:7]) + counter + sum(can_id.to_bytes(4, 'big'))",
            "(4",
            "(5",
        ),
    )
}
