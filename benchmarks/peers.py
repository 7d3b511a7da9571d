"""Compare a control step of floatbase with TSID and placo, two C++ libraries: torques, then times.

    python benchmarks/peers.py                  creates environments, compares, measures ->
                                                benchmarks/peers.md, peers.png
    python benchmarks/peers.py --env FOLDER     where the peers' environments are kept;
                                                build/peers by default
    python benchmarks/peers.py --peers placo    only these

Each library runs in its own process and environment, through its own Python binding, on the same
states. Blocks of control steps alternate, so that other load on the machine affects both.
`peer_problems.py` describes how the problems are made equal.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import harness
import numpy as np
import peer_problems
from harness import ROBOTS, SPREADS, microseconds
from peer_environments import MissingError, python_of, versions
from peer_problems import LIMITED
from peer_wire import Process

HERE = Path(__file__).parent
JOINT_LIMITS = ("position limit", "velocity limit", "acceleration limit")  # kinds of constraints
# of the strongest motor's limit, by which torques may differ for the optimum to count as one
TOLERANCE = 1e-6
PACKAGES = {"tsid": ("tsid", "pin"), "placo": ("placo", "pin")}
RUNS = {"tsid": ("tsid", *LIMITED), "placo": ("placo",)}  # problems of `peer_problems`


@dataclass(frozen=True)
class Row:
    """One robot, one peer, one kind of states.

    unanswered: states without an answer, ours and theirs. differences: of the torques in each state
    [N·m]; up to `tolerance`, they count as none. within: the largest difference between the
    compiled and the reference backend on every fifth state [N·m]. ours, theirs: times [µs]. ratios:
    of the medians of each block.
    """

    robot: str
    peer: str
    label: str
    states: int
    unanswered: list[int]
    tolerance: float
    differences: np.ndarray
    within: float
    ours: np.ndarray
    theirs: np.ndarray
    ratios: np.ndarray
    is_cold: bool = False

    @property
    def difference(self) -> float:
        """The largest, N·m; infinite where there is none."""
        return float(np.max(self.differences)) if self.states else np.inf

    @property
    def is_same(self) -> bool:
        """Whether the torques agree, so that times can be compared."""
        return self.difference <= self.tolerance

    @property
    def ratio(self) -> float:
        """Our median over theirs in each turn, and of these the median."""
        return float(np.median(self.ratios)) if self.states else np.nan

    @property
    def middle(self) -> str:
        """The middle of the ratios."""
        low, high = np.percentile(self.ratios, [10, 90])
        return f"{low:.2f} to {high:.2f}"

    @property
    def missing(self) -> str:
        """States without an answer, ours and theirs."""
        return " and ".join(map(str, self.unanswered))


def compare(pair: Sequence[Process], robot: str, peer: str, n: int, rounds: int) -> Iterator[Row]:
    """Rows of one robot and one peer."""
    problem = peer_problems.problem(robot, peer)
    states = {
        label: [(q.tolist(), v.tolist()) for q, v in problem.states(label, n)] for label in SPREADS
    }
    for process in pair:
        process.ask("problem", problem.description)
        process.ask("states", states)
    found = {label: [process.ask("torques", label) for process in pair] for label in SPREADS}
    kept = {
        label: [i for i, both in enumerate(zip(*found[label], strict=True)) if None not in both]
        for label in SPREADS
    }
    states = {label: [states[label][i] for i in kept[label]] for label in SPREADS}
    for process in pair:
        process.ask("states", states)
    # every turn has all rows, so that a slow second of the machine does not fall on one row
    clocks = {"clock": rounds}
    if peer in PACKAGES:
        clocks["cold"] = max(1, rounds // 20)  # each tick waits for 16 MB
    turns = {
        clock: [
            {label: [process.ask(clock, label) for process in pair] for label in SPREADS}
            for _ in range(n_turns)
        ]
        for clock, n_turns in clocks.items()
    }
    for label, clock in product(SPREADS, clocks):
        ours, theirs = ([np.array(torques[i]) for i in kept[label]] for torques in found[label])
        times = np.array([turn[label] for turn in turns[clock]])
        medians = np.median(times, axis=2)
        yield Row(
            robot,
            peer,
            label,
            states=len(kept[label]),
            unanswered=[sum(tau is None for tau in torques) for torques in found[label]],
            tolerance=TOLERANCE * float(np.max(problem.robot.torque_limits)),
            differences=_differences(ours, theirs),
            within=_within(problem, ours, states[label]),
            ours=times[:, 0].ravel(),
            theirs=times[:, 1].ravel(),
            ratios=medians[:, 0] / medians[:, 1],
            is_cold=clock == "cold",
        )


def _differences(ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> np.ndarray:
    """The largest of each state's torques, N·m."""
    return np.array([np.max(np.abs(one - other)) for one, other in zip(ours, theirs, strict=True)])


def _within(problem: peer_problems.Problem, ours: Sequence[np.ndarray], states: Sequence) -> float:
    """The largest difference from floatbase's reference backend on some of the states, N·m, where
    that says who rounds.
    """
    if not states:
        return np.nan
    reference = problem.controller("reference")
    return float(np.max(_differences(ours[::5], [reference(q, v).tau for q, v in states[::5]])))


def ours(backend: str) -> Process:
    """floatbase, in the environment that runs this."""
    return Process(Path(sys.executable), HERE / "peer_ours.py", [backend], [HERE.parent])


def measure(peer: str, python: Path, n: int, rounds: int) -> Iterator[Row]:
    """Every row of one peer."""
    for name, robot in product(RUNS[peer], ROBOTS):
        pair = [ours("compiled"), Process(python, HERE / f"peer_{peer}.py")]
        yield from compare(pair, robot, name, n, rounds)
        for process in pair:
            process.close()


# results ------------------------------------------------------------------------------------------


def torque_table(rows: Sequence[Row]) -> str:
    return harness.table(
        "robot | peer | states | compared | no answer: floatbase, peer | largest difference "
        "| from the reference backend",
        (
            [row.robot, row.peer, row.label, row.states]
            + [row.missing, f"{row.difference:.1e} N·m", f"{row.within:.1e} N·m"]
            for row in rows
        ),
    )


def time_table(rows: Sequence[Row]) -> str:
    return harness.table(
        "robot | peer | states | floatbase median | floatbase p99 | peer median | peer p99 | ratio "
        "| 10 to 90 % of blocks",
        (
            [row.robot, row.peer, row.label]
            + microseconds(np.percentile([row.ours, row.theirs], [50, 99], axis=1).T.ravel())
            + [f"**{row.ratio:.2f}**", row.middle]
            for row in rows
        ),
    )


def limits_table(rows: Sequence[Row]) -> str:
    """TSID with joint limits: torques, how many states have active limits, and ratios."""

    def cells(row: Row) -> list[object]:
        problem = peer_problems.problem(row.robot, row.peer)
        controller = problem.controller("compiled")
        active = sum(
            any(name.kind.endswith(JOINT_LIMITS) for name in controller(q, v).active)
            for q, v in problem.states(row.label, row.states)
        )
        ratio = f"**{row.ratio:.2f}**" if row.is_same else "torques differ"
        first = [row.robot, row.peer, row.label, row.states, active]
        return [*first, row.missing, f"{row.difference:.1e} N·m", ratio, row.middle]

    return harness.table(
        "robot | peer | states | compared | active limits | no answer: floatbase, peer | largest "
        "difference | ratio | 10 to 90 % of blocks",
        map(cells, rows),
    )


def plot(rows: Sequence[Row]) -> None:
    """Median control steps side by side, a row of pictures for each peer."""
    import matplotlib.pyplot as plt

    peers = list(dict.fromkeys(row.peer for row in rows))
    size = (9.0, 2.6 * len(peers))
    figure, axes = plt.subplots(
        len(peers), len(ROBOTS), figsize=size, constrained_layout=True, squeeze=False
    )
    for ax, (peer, robot) in zip(axes.flat, product(peers, ROBOTS), strict=True):
        chosen = [row for row in rows if (row.peer, row.robot) == (peer, robot)]
        x, theirs = np.arange(len(chosen)), [float(np.median(row.theirs)) for row in chosen]
        ax.bar(x - 0.2, theirs, 0.4, label="the peer", color="0.65")
        ours = [float(np.median(row.ours)) for row in chosen]
        ax.bar(x + 0.2, ours, 0.4, label="floatbase", color="tab:blue")
        for at, row in zip(zip(x, theirs, strict=True), chosen, strict=True):
            above = {"xytext": (0, 3), "textcoords": "offset points", "ha": "center"}
            ax.annotate(f"{row.ratio:.2f} ×", at, **above)
        ax.set_xticks(x, [row.label for row in chosen])
        ax.set(title=f"{robot} against {peer}", ylabel="median control step [µs]")
        ax.margins(y=0.15)
        ax.spines[["top", "right"]].set_visible(False)
    labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(*labels, loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(HERE / "peers.png", dpi=120)


INTRODUCTION = """\
Ratios are reliable; absolute times depend on the machine. A ratio is the median over turns. In each
turn both libraries solve all states, one after the other. Each control step goes from q and v to
torques, in Python, through each library's own binding: `computeProblemData`, `solve` and
`getActuatorForces` for TSID, `update_kinematics` and `solve` for placo, `controller(q, v)` for
floatbase. The peers are the packages on PyPI, compiled for any processor of the architecture. numba
compiles floatbase's control step for the processor in use."""

COLD = """\
A controller runs between other work, which replaces the contents of the processor's caches. Here,
16 MB are written before each control step of both libraries. The time does not include this."""

LIMITS = """\
The problem is the one above, with hard joint limits: `TaskJointPosVelAccBounds` in TSID,
`JointLimits(weight=None)` in floatbase. Both bound the joint accelerations by positions,
velocities, accelerations and viability after a period of 4 ms. "tsid limits" uses the
braking accelerations of `JointLimits.of(robot)`. "tsid tight limits" uses at most 20 rad/s².
Differences between the libraries are equalized or left out:

- TSID limits accelerations to the braking acceleration. floatbase has a reserve of twice the
  braking acceleration. Here, the acceleration limit switches this reserve off.
- floatbase keeps speeds 0.3 % below their limits; TSID gets these lower limits.
- TSID doubles the time step given to its constructor, so it is given half the period.
- The limits are hard, because TSID has no soft inequalities.
- States from which a joint cannot stop in time are left out. There, TSID replaces one of two
  contradictory bounds with the other, and floatbase demands the largest deceleration."""

SAMENESS = """\
Torques are compared before times. They count as equal if they differ by at most a millionth of the
strongest motor's limit. The remaining difference is rounding in the peers' solver, because
floatbase's compiled and reference backends, which share no solver, agree more closely (on every
fifth state)."""


def report(rows: list[Row], used: dict[str, str], lacking: list[str]) -> None:
    """Write peers.md."""
    equal = [row for row in rows if row.peer not in LIMITED and not row.is_cold]
    cold = [row for row in rows if row.is_same and row.is_cold]
    peers = "; ".join(f"{peer}: {packages}" for peer, packages in used.items())
    parts = [f"`python benchmarks/peers.py` on {harness.machine()}. {peers}."]
    parts += [f"**Not measured: {why}**" for why in lacking]
    problem = (peer_problems.__doc__ or "").strip()
    parts += [INTRODUCTION, "## The common problem", problem, SAMENESS, torque_table(equal)]
    parts += [
        f"Torques differ, so times are not compared: {row.robot} with {row.peer}, {row.label}."
        for row in equal
        if not row.is_same
    ]
    parts += ["## Times", time_table([row for row in equal if row.is_same])]
    if cold:
        parts += ["## Times with cold caches", COLD, time_table(cold)]
    limited = [row for row in rows if row.peer in LIMITED]
    if limited:
        parts += ["## Joint limits", LIMITS, limits_table(limited)]
    harness.write(__file__, "Computing time of floatbase, TSID and placo", *parts)


def main() -> int:
    parser = harness.command_line(
        __doc__,
        states=(200, "random states for each row"),
        rounds=(100, "turns that each side takes"),
    )
    environments = HERE.parent / "build" / "peers"
    parser.add_argument("--env", type=Path, default=environments, help="the peers' environments")
    parser.add_argument("--peers", nargs="+", choices=PACKAGES, default=list(PACKAGES))
    options = parser.parse_args()
    rows: list[Row] = []
    used: dict[str, str] = {}
    lacking: list[str] = []
    for peer in options.peers:
        try:
            python = python_of(peer, options.env.resolve())
            used[peer] = versions(python, PACKAGES[peer])
            for row in measure(peer, python, options.states, options.rounds):
                told = f"{row.robot} {row.peer} {row.label}{' cold' * row.is_cold}"
                print(f"{told}: {row.difference:.1e} N·m, {row.ratio:.2f} ×", flush=True)
                rows.append(row)
        except (MissingError, RuntimeError) as error:
            lacking.append(f"{peer}. {error}")
            print(f"No {peer}: {error}", flush=True)
    report(rows, used, lacking)
    warm = [row for row in rows if row.is_same and row.peer not in LIMITED and not row.is_cold]
    if warm:
        plot(warm)
    return 1 if lacking else 0


if __name__ == "__main__":
    sys.exit(main())
