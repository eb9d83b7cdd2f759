"""A formula for a force that has no name: symbolic regression on the signals it varies with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy
from numpy.typing import NDArray
from pyoperon.sklearn import SymbolicRegressor
from sympy.printing.str import StrPrinter

from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.free_law import LEAST_R2
from deeptruck_model.mismatch.posterior.modelled import Formula, drivers, unexplained
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DRIVERS = 3
CELLS = 256  # points the formula is fitted to, each the mean over equally many seconds
LEAST_IN_CELL = 12
DIGITS = 3
GRID = 21  # places along the range of each signal where a formula must stay bounded
BEYOND = 3.0  # times the largest force seen, which a formula must stay below at these places
SYMBOLS = "add,sub,mul,div,square,exp,tanh,sin,fmax,fmin,abs,constant,variable"
FUNCTIONS = {"fmax": sympy.Max, "fmin": sympy.Min, "max": sympy.Max, "min": sympy.Min, "abs": sympy.Abs}
FUNCTIONS |= {"square": lambda x: x**2}


def formula(e: Evidence, x: Explanation, seed: int = 0) -> Formula | None:
    """The simplest formula that predicts the unexplained force on held-out recordings as well as any.

    None where there is too little data or no formula predicts much.
    """
    named = drivers(x, DRIVERS)
    y, columns, out = unexplained(e, x, named)
    if not named or min((~out).sum(), out.sum()) < 4 * LEAST_IN_CELL:
        return None
    return fit(columns, y * e.unit.scale, out, seed)


def fit(columns: dict[str, Array], y: Array, held_out: Mask, seed: int = 0) -> Formula | None:
    """Symbolic regression of y (n,) on named columns (n,), most important first, judged on `held_out` rows.

    None where no formula predicts LEAST_R2 of their variance.
    """
    symbols = [sympy.Symbol(name, real=True) for name in columns]
    X = np.stack(list(columns.values()), axis=1)
    candidates: list[sympy.Expr] = []
    for count in range(1, len(symbols) + 1):  # fewer signals leave finer cells
        front = _front(*cells(X[~held_out, :count], y[~held_out]), seed)
        candidates += [_readable(text, symbols) for text in front]
    candidates = [c for c in candidates if _bounded(c, symbols, X, y)]
    losses = [_losses(c, symbols, X[held_out], y[held_out]) for c in candidates]
    best = min(losses, key=lambda loss: float(loss.mean()), default=None)
    variance = float(np.var(y[held_out]))
    if best is None or best.mean() > (1.0 - LEAST_R2) * variance:
        return None
    # the shortest within one standard error of the best (Breiman et al., Classification and Regression
    # Trees, 1984)
    enough = float(best.mean() + best.std() / np.sqrt(len(best)))
    good = [(c, float(loss.mean())) for c, loss in zip(candidates, losses, strict=True)]
    chosen, loss = min(
        ((c, mean) for c, mean in good if mean <= enough), key=lambda item: (_length(item[0]), item[1])
    )
    r2 = 1.0 - loss / variance
    return Formula(_text(chosen), r2, tuple(s.name for s in symbols if s in chosen.free_symbols))


def cells(X: Array, y: Array) -> tuple[Array, Array]:
    """Means over cells of equally many rows, made by splitting the widest side in half again and again.

    Equal counts give points of equal noise, so they need no weights.
    """
    scale = X.std(axis=0) + 1e-12
    parts = [np.arange(len(y))]
    while 2 * len(parts) <= CELLS and len(parts[0]) >= 2 * LEAST_IN_CELL:
        halves = []
        for part in parts:
            side = int(np.argmax(np.ptp(X[part] / scale, axis=0)))
            order = part[np.argsort(X[part, side], kind="stable")]
            halves += [order[: len(order) // 2], order[len(order) // 2 :]]
        parts = halves
    return np.stack([X[p].mean(axis=0) for p in parts]), np.array([y[p].mean() for p in parts])


def _front(X: Array, y: Array, seed: int) -> list[str]:
    """Formulas of ever greater length and fit, in X1, X2, ...; the same for the same data and seed."""
    search = SymbolicRegressor(
        allowed_symbols=SYMBOLS,
        objectives=["r2", "length"],
        max_length=24,
        max_depth=7,
        population_size=500,
        generations=40,
        max_evaluations=150_000,
        optimizer_iterations=8,
        epsilon=1e-4,
        n_threads=1,
        max_time=30,  # s; a guard alone: generations end it sooner, also on a busy machine
        random_state=seed,
    )
    search.fit(X, y)
    return [str(p["model"]) for p in search.pareto_front_]


def _readable(text: str, symbols: Sequence[sympy.Symbol]) -> sympy.Expr:
    """The library's text as an expression in the signals, constants rounded, expanded if that is shorter."""
    known = FUNCTIONS | {f"X{i + 1}": symbol for i, symbol in enumerate(symbols)}
    found = sympy.parse_expr(text.replace("^", "**"), local_dict=known)
    return min((_rounded(found), _rounded(sympy.expand(found))), key=_length)


def _rounded(x: sympy.Expr) -> sympy.Expr:
    def constant(c: sympy.Float) -> sympy.Expr:
        short = float(f"{float(c):.{DIGITS}g}")
        return sympy.Integer(int(short)) if short.is_integer() else sympy.Float(short)

    return x.xreplace({c: constant(c) for c in x.atoms(sympy.Float)})


def _length(x: sympy.Expr) -> int:
    return sum(1 for _ in sympy.preorder_traversal(x))


def _losses(x: sympy.Expr, symbols: Sequence[sympy.Symbol], X: Array, y: Array) -> Array:
    """Squared errors (n,), infinite where the formula is none."""
    with np.errstate(all="ignore"):
        predicted = np.broadcast_to(sympy.lambdify(symbols, x, "numpy", dummify=True)(*X.T), y.shape)
        loss = (y - predicted.astype(np.float64)) ** 2
    return np.where(np.isfinite(loss), loss, np.inf)


def _bounded(x: sympy.Expr, symbols: Sequence[sympy.Symbol], X: Array, y: Array) -> bool:
    """Whether a formula stays within what was seen, all over the range of its signals: no pole between the
    cells it was fitted to."""
    sides = [np.linspace(column.min(), column.max(), GRID) for column in X.T]
    places = np.concatenate([X, np.stack([g.ravel() for g in np.meshgrid(*sides)], axis=1)])
    with np.errstate(all="ignore"):
        force = np.broadcast_to(sympy.lambdify(symbols, x, "numpy", dummify=True)(*places.T), len(places))
    return bool(np.isfinite(force).all() and np.abs(force).max() < BEYOND * np.abs(y).max())


class _Printer(StrPrinter):
    """Constants in plain digits, signals of several words in brackets."""

    def _print_Float(self, x: sympy.Float) -> str:  # noqa: N802
        return f"{float(x):.{DIGITS}g}" if 1e-4 <= abs(float(x)) < 1e6 else f"{float(x):.2e}"

    def _print_Symbol(self, x: sympy.Symbol) -> str:  # noqa: N802
        return f"[{x.name}]" if " " in x.name else str(x.name)


def _text(x: sympy.Expr) -> str:
    return (
        str(_Printer().doprint(x))
        .replace("**", "^")
        .replace("*", " * ")
        .replace("Max", "max")
        .replace("Min", "min")
    )
