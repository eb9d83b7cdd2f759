"""Ten seeds of the paper's TRPO on the physics truck, and causes for which seeds fail, tested one at a time.

python benchmarks/bench_trpo.py [--work runs/trpo] [--iterations 200]

Finished trainings in --work are reused, unfinished ones resumed.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import harness
import numpy as np

from deeptruck_cacc import training
from deeptruck_cacc.evaluation import figures
from deeptruck_cacc.training.settings import TrpoConfig
from deeptruck_model import simulators

SIMULATOR, SEEDS = "truck:trucksim", 10
FEW, EARLY = 5, 30  # seeds and iterations of the runs that look for causes
FOLLOWS = 0.2  # validation of a seed that follows
LAST = 20  # iterations at the end: 500 paths of each seed
CAUSES: dict[str, dict[str, Any]] = {
    "network, 0.97 (sb3-contrib's)": {"baseline": "network", "gae_lambda": 0.97},
    "network, 1": {"baseline": "network", "gae_lambda": 1.0},
    "linear of the batch before, 0.97": {"baseline": "linear-before", "gae_lambda": 0.97},
    "linear of the batch before, 1 (RLLab's)": {"baseline": "linear-before", "gae_lambda": 1.0},
    "linear of the batch itself, 1 (ours)": {"baseline": "linear", "gae_lambda": 1.0},
}
SAYS = """The paper's setting on the physics truck `trucksim`: batches of 20,000 steps, paths of 800, discount
0.9999, 3 x 25 units, five signals. The trust region begins at KL 0.01 and falls to nothing. The paper
trained in RLLab, whose TRPO compares whole returns (GAE of 1) with a linear baseline; ours is fitted to the
batch itself. All ten seeds run in one batch.

Validation is the worst time-gap error after 10 s, in s, plus the worst speed error behind steady leaders,
and 10 for a crash. Its scenes hold moving leaders, hills and hidden command gains, which this training
never sees. A seed follows from 0.2 down. The kept policy is the one of the best validation.

![learning curves](trpo/learning_curve.png)"""
WHY = f"""One cause at a time: the first {FEW} seeds in runs of {EARLY} iterations, by baseline and GAE.
What loses most is the short reach of 0.97: an action is charged for 3 s, and a truck that stands keeps
standing. With whole returns the baseline is next. A network learns by steps of fixed length and lags behind
returns of thousands. After a crash, the batch before says nothing of this one."""


def main() -> None:
    """Print the tables and write its section of docs/results/following.md, with the figure in trpo/."""
    args = harness.options(__doc__, {"--work": Path("runs/trpo"), "--iterations": 200})
    curves = learn(args.work / "policy", TrpoConfig(seeds=SEEDS, iterations=args.iterations))
    figures.learning_curve(curves, harness.RESULTS / "trpo" / "learning_curve.png")
    title = f"Ten seeds of the paper's TRPO, {args.iterations} iterations"
    lines = [*harness.heading(title, "; its first part is"), "```bash"]
    lines += [f"deeptruck-cacc train --trainer trpo --seeds {SEEDS} --iterations {args.iterations} \\"]
    lines += [f"  --simulator {SIMULATOR} --out policies/trpo", "```", "", SAYS, "", *seeds(curves), ""]
    harness.store("following", [*lines, WHY, "", *causes(args.work)])


def learn(policy: Path, config: TrpoConfig) -> list[list[dict[str, Any]]]:
    """The learning curve of each seed, which is trained if it does not exist."""
    if not (policy / "policy.json").exists():
        began, truck = time.process_time(), simulators.load(SIMULATOR)
        training.train(
            truck, policy, trainer="trpo", config=config, source=SIMULATOR, resume=training.begun(policy)
        )
        print(f"{policy}: {time.process_time() - began:.0f} CPU s")
    lines = [(policy / "seeds" / str(k) / "learning_curve.jsonl").read_text() for k in range(config.seeds)]
    return [[json.loads(line) for line in text.splitlines()] for text in lines]


def seeds(curves: list[list[dict[str, Any]]]) -> list[str]:
    """Return, best and last validation of each seed, and the number of seeds that follow."""
    rows = [validations(curve) for curve in curves]
    late = [np.mean([line["return_mean"] for line in curve[-5:]]) for curve in curves]
    worst = [min(line["return_min"] for line in curve[-LAST:]) for curve in curves]
    best = [min(row, key=lambda pair: pair[1]) for row in rows]
    kept = [np.mean([v <= FOLLOWS for _, v in row[len(row) // 2 :]]) for row in rows]
    first = [next((at for at, v in row if v <= FOLLOWS), None) for row in rows]
    table = {
        "return, mean of the last 5 iterations": [f"{x:.1f}" for x in late],
        f"worst of the paths of the last {LAST}": [f"{x:.1f}" for x in worst],
        "follows first at iteration": ["never" if at is None else str(at) for at in first],
        "best validation": [f"{v:.3f}" for _, v in best],
        "at iteration": [str(at) for at, _ in best],
        "validations of the second half that follow (%)": [f"{100 * x:.0f}" for x in kept],
        "last validation": [f"{row[-1][1]:.3g}" for row in rows],
    }
    heads = f"seed | {' | '.join(map(str, range(len(curves))))}"
    lines = harness.table(heads, (f"{name} | {' | '.join(cells)}" for name, cells in table.items()))
    ends = sum(row[-1][1] <= FOLLOWS for row in rows)
    return [*lines, "", f"{sum(v <= FOLLOWS for _, v in best)} of {len(rows)} follow; at the end {ends} do."]


def causes(work: Path) -> list[str]:
    """Number of seeds that follow early, by baseline and GAE."""
    rows = []
    for number, (name, settings) in enumerate(CAUSES.items()):
        config = TrpoConfig(seeds=FEW, iterations=EARLY, **settings)
        curves = learn(work / f"cause{number}", config)
        best = [min(v for _, v in validations(curve)) for curve in curves]
        returns = [curve[-1]["return_mean"] for curve in curves]
        follow = sum(v <= FOLLOWS for v in best)
        cells = f"{follow} | {np.median(best):.2g} | {np.median(returns):.0f} ({min(returns):.0f})"
        rows.append(f"{name} | {cells}")
    return harness.table(
        "baseline, GAE | seeds that follow | validation, median | return, median (worst)", rows
    )


def validations(curve: list[dict[str, Any]]) -> list[tuple[int, float]]:
    """(iteration, validation) of the iterations that were validated."""
    return [(line["iteration"] + 1, line["validation"]) for line in curve if "validation" in line]


if __name__ == "__main__":
    main()
