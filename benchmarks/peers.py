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

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import peer_problems
from peer_environments import MissingError, python_of, versions
from peer_problems import LIMITED, ROBOTS, SPREADS
from peer_wire import Process
from tick import JOINT_LIMITS, machine

HERE = Path(__file__).parent
# of the strongest motor's limit, by which torques may differ for the optimum to count as one
TOLERANCE = 1e-6
PACKAGES = {"tsid": ("tsid", "pin"), "placo": ("placo", "pin")}
PLANAR = "placo planar"  # placo's own flat foot, an easier problem
SIDES = {
    "tsid": "peer_tsid.py",
    **dict.fromkeys(LIMITED, "peer_tsid.py"),
    "placo": "peer_placo.py",
    PLANAR: "peer_placo.py",
}
RUNS = {  # our way, whom it is measured beside, robots
    "tsid": (
        ("compiled", "tsid", ROBOTS),
        ("own", "tsid", ROBOTS),
        ("reference", "tsid", ("go2",)),
        *(("compiled", limited, ROBOTS) for limited in LIMITED),
    ),
    "placo": (("compiled", "placo", ROBOTS), ("compiled", PLANAR, ("talos",))),
}


@dataclass(frozen=True)
class Row:
    """One of our ways (`peer_problems.WAYS`), one robot, one peer, one kind of states.

    differences: of the torques, for each state, N·m; those up to tolerance count as none. within:
        the largest between
    the path measured and the reference one on every fifth state, N·m. ours, theirs: times, µs.
    ratios: of the medians of each block.
    """

    way: str
    robot: str
    peer: str
    label: str
    states: int
    unanswered: tuple[int, int]
    tolerance: float
    differences: np.ndarray
    within: float
    ours: np.ndarray
    theirs: np.ndarray
    ratios: np.ndarray
    stages: dict[str, float]

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


def compare(
    pair: Sequence[Process], way: str, robot: str, peer: str, n: int, rounds: int
) -> Iterator[Row]:
    """Rows of one robot, one of our ways and one peer."""
    problem = peer_problems.problem(robot, peer)
    everything = {
        label: [(q.tolist(), v.tolist()) for q, v in problem.states(label, n)] for label in SPREADS
    }
    for process in pair:
        process.ask("problem", problem.description)
        process.ask("states", everything)
    found = {label: [process.ask("torques", label) for process in pair] for label in SPREADS}
    kept = {
        label: [i for i, both in enumerate(zip(*found[label], strict=True)) if None not in both]
        for label in SPREADS
    }
    for process in pair:
        process.ask(
            "states", {label: [everything[label][i] for i in kept[label]] for label in SPREADS}
        )
    turns: dict[str, list[list[list[float]]]] = {label: [] for label in SPREADS}
    for _ in range(rounds):
        # all rows in every turn: a slow second of the machine is then a few turns of each, not one
        # row
        for label in SPREADS:
            turns[label].append([process.ask("clock", label) for process in pair])
    for label in SPREADS:
        ours, theirs = ([np.array(torques[i]) for i in kept[label]] for torques in found[label])
        unanswered = tuple(sum(tau is None for tau in torques) for torques in found[label])
        times = np.array(turns[label])
        medians = np.median(times, axis=2)
        yield Row(
            way,
            robot,
            peer,
            label,
            len(kept[label]),
            unanswered,
            TOLERANCE * float(np.max(problem.robot.torque_limits)),
            _differences(ours, theirs),
            _within(problem, ours, [everything[label][i] for i in kept[label]]),
            times[:, 0].ravel(),
            times[:, 1].ravel(),
            medians[:, 0] / medians[:, 1],
            pair[1].ask("stages", label),
        )


def _differences(ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> np.ndarray:
    """The largest of each state's torques, N·m."""
    return np.array([np.max(np.abs(one - other)) for one, other in zip(ours, theirs, strict=True)])


def _within(problem: peer_problems.Problem, ours: Sequence[np.ndarray], states: Sequence) -> float:
    """The largest difference from floatbase's reference backend on some of the states, N·m, where
    that says who rounds.
    """
    if problem.peer == PLANAR or not states:
        return np.nan
    reference = problem.controller("reference")
    return float(np.max(_differences(ours[::5], [reference(q, v).tau for q, v in states[::5]])))


def ours(way: str) -> Process:
    """floatbase, in the environment that runs this."""
    return Process(Path(sys.executable), HERE / "peer_ours.py", [way], [HERE.parent])


def measure(peer: str, python: Path, n: int, rounds: int) -> Iterator[Row]:
    """Every row of one peer."""
    for way, name, robot in [
        (way, name, robot) for way, name, robots in RUNS[peer] for robot in robots
    ]:
        pair = [ours(way), Process(python, HERE / SIDES[name])]
        some = (
            (max(1, n // 6), min(20, rounds)) if way == "reference" else (n, rounds)
        )  # it takes long
        yield from compare(pair, way, robot, name, *some)
        for process in pair:
            process.close()


# results ------------------------------------------------------------------------------------------


def torque_table(rows: Sequence[Row]) -> Iterator[str]:
    yield (
        "| our way | robot | peer | states | compared | no answer: ours, peer | largest "
        "difference | from our reference |"
    )
    yield "|---" * 8 + "|"
    for row in rows:
        missing, size = (
            " and ".join(map(str, row.unanswered)),
            f"{row.difference:.1e} N·m | {row.within:.1e} N·m",
        )
        yield (
            f"| {row.way} | {row.robot} | {row.peer} | {row.label} | {row.states} | {missing} | "
            f"{size} |"
        )


def time_table(rows: Sequence[Row], name: str = "floatbase") -> Iterator[str]:
    yield (
        f"| robot | peer | states | {name} median | {name} p99 | peer median | peer p99 | ratio "
        f"| 10 to 90 % of blocks |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for row in rows:
        numbers = " | ".join(
            f"{x:.1f} µs"
            for x in (*np.percentile(row.ours, [50, 99]), *np.percentile(row.theirs, [50, 99]))
        )
        low, high = np.percentile(row.ratios, [10, 90])
        yield (
            f"| {row.robot} | {row.peer} | {row.label} | {numbers} | **{row.ratio:.2f}** | "
            f"{low:.2f} to {high:.2f} |"
        )


def stage_table(rows: Sequence[Row]) -> Iterator[str]:
    yield "| robot | peer | states | time of each call |"
    yield "|---|---|---|---|"
    for row in rows:
        parts = ", ".join(f"{name} {spent:.1f} µs" for name, spent in row.stages.items())
        yield f"| {row.robot} | {row.peer} | {row.label} | {parts} |"


def plot(rows: Sequence[Row]) -> None:
    """Median ticks side by side, a row of pictures for each peer."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    peers = list(dict.fromkeys(row.peer for row in rows))
    size = (9.0, 2.6 * len(peers))
    figure, axes = plt.subplots(
        len(peers), len(ROBOTS), figsize=size, constrained_layout=True, squeeze=False
    )
    for ax, (peer, robot) in zip(
        axes.flat, [(peer, robot) for peer in peers for robot in ROBOTS], strict=True
    ):
        chosen = [row for row in rows if (row.peer, row.robot) == (peer, robot)]
        for shift, times, label, color in (
            (-0.2, "theirs", "the peer", "0.65"),
            (0.2, "ours", "floatbase", "tab:blue"),
        ):
            heights = [float(np.median(getattr(row, times))) for row in chosen]
            ax.bar(np.arange(len(chosen)) + shift, heights, 0.4, label=label, color=color)
        for x, row in enumerate(chosen):
            ax.annotate(
                f"{row.ratio:.2f} ×",
                (x, np.median(row.theirs)),
                (0, 3),
                textcoords="offset points",
                ha="center",
            )
        ax.set_xticks(range(len(chosen)), [row.label for row in chosen])
        ax.set(title=f"{robot} against {peer}", ylabel="median control step [µs]")
        ax.margins(y=0.15)
        ax.spines[["top", "right"]].set_visible(False)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False
    )
    figure.savefig(HERE / "peers.png", dpi=120)


INTRODUCTION = """\
Ratios are reliable; absolute times depend on the machine. A ratio is the median over turns. In each
turn both libraries solve all states, one after the other. Each control step goes from q and v to
torques, in Python, through each library's own binding: `computeProblemData`, `solve` and
`getActuatorForces` for TSID, `update_kinematics` and `solve` for placo, `controller(q, v)` for
floatbase. The peers are the packages on PyPI, compiled for any processor of the architecture. numba
compiles floatbase's control step for the processor in use."""

OWN = """\
floatbase accepts tasks written in Python. TSID's binding accepts only its own classes:
`addMotionTask` has an overload for each of them, and C++ never calls what a Python subclass
overrides, so a custom task has to be written in C++. These rows therefore do not compare the same
thing; they show the cost of a task in Python. The problem is the one above, but floatbase's task
for the centre of mass is the class `OwnCoM` of `benchmarks/tick.py`, called at every control step,
while TSID uses its `TaskComEquality`."""

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


def report(rows: list[Row], used: dict[str, dict[str, str]], lacking: list[str]) -> str:
    """The text of peers.md."""
    equal = [row for row in rows if row.peer != PLANAR and row.peer not in LIMITED]
    other = [row for row in equal if not row.is_same]
    compiled, own, reference = (
        [row for row in equal if row.is_same and row.way == way] for way in peer_problems.WAYS
    )
    peers = "; ".join(
        f"{peer}: " + ", ".join(f"{k} {v}" for k, v in each.items()) for peer, each in used.items()
    )
    lines = [
        "# Computing time of floatbase, TSID and placo",
        "",
        f"`python benchmarks/peers.py` on {machine()}. {peers}.",
        "",
    ]
    lines += [f"**Not measured: {why}**\n" for why in lacking]
    lines += [INTRODUCTION, ""]
    lines += [
        "## The common problem",
        "",
        (peer_problems.__doc__ or "").strip(),
        "",
        SAMENESS,
        "",
        *torque_table(equal),
        "",
    ]
    lines += [
        f"Torques differ, so times are not compared: "
        f"{row.robot} with {row.peer}, {row.label}, {row.way}.\n"
        for row in other
    ]
    lines += ["## Times", "", *time_table(compiled), ""]
    if reference:
        lines += [
            'The reference backend, `backend="reference"`:',
            "",
            *time_table(reference, "reference"),
            "",
        ]
    lines += [
        "Time of each call inside the peers' control steps (medians):",
        "",
        *stage_table(compiled),
        "",
    ]
    if own:
        lines += ["## A user-defined task", "", OWN, "", *time_table(own, "own task"), ""]
    limited = [row for row in rows if row.peer in LIMITED]
    if limited:
        lines += ["## Joint limits", "", LIMITS, "", *limits_section(limited), ""]
    planar = [row for row in rows if row.peer == PLANAR]
    if planar:
        lines += ["## An easier problem", "", *planar_section(planar), ""]
    return "\n".join(lines)


def limits_section(rows: Sequence[Row]) -> Iterator[str]:
    """TSID with joint limits: torques, how many states have active limits, and ratios."""
    yield (
        "| robot | peer | states | compared | active limits | no answer: floatbase, peer | "
        "largest difference | ratio | 10 to 90 % of blocks |"
    )
    yield "|---" * 9 + "|"
    for row in rows:
        problem = peer_problems.problem(row.robot, row.peer)
        controller = problem.controller("compiled")
        active = sum(
            any(name.kind.endswith(JOINT_LIMITS) for name in controller(q, v).active)
            for q, v in problem.states(row.label, row.states)
        )
        ratio = f"**{row.ratio:.2f}**" if row.is_same else "torques differ"
        low, high = np.percentile(row.ratios, [10, 90])
        yield (
            f"| {row.robot} | {row.peer} | {row.label} | {row.states} | {active} | "
            f"{' and '.join(map(str, row.unanswered))} | {row.difference:.1e} N·m | {ratio} | "
            f"{low:.2f} to {high:.2f} |"
        )


def planar_section(rows: Sequence[Row]) -> Iterator[str]:
    """placo's own flat foot, which floatbase has no equal to."""
    yield (
        "placo's own flat foot has six variables instead of twelve and no limit on the moment "
        "about its normal, so its problem is easier. Its torques equal those of floatbase where "
        "friction at the corners can produce its wrenches."
    )
    yield ""
    for row in rows:
        agree, largest = (
            int(np.sum(row.differences <= row.tolerance)),
            f"the largest difference is {row.difference:.1f} N·m",
        )
        yield f"- {row.label}: {agree} of {row.states} states have the same torques; {largest}."
    yield ""
    yield from time_table(rows)


def main() -> None:
    ask = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    ask.add_argument(
        "--env",
        type=Path,
        default=HERE.parent / "build" / "peers",
        help="folder of the peers' environments",
    )
    ask.add_argument("--peers", nargs="+", choices=PACKAGES, default=list(PACKAGES))
    ask.add_argument("--states", type=int, default=200, help="random states for each row")
    ask.add_argument("--rounds", type=int, default=100, help="turns that each side takes")
    options = ask.parse_args()
    rows: list[Row] = []
    used: dict[str, dict[str, str]] = {}
    lacking: list[str] = []
    for peer in options.peers:
        try:
            python = python_of(peer, options.env.resolve())
            used[peer] = versions(python, PACKAGES[peer])
            for row in measure(peer, python, options.states, options.rounds):
                told = f"{row.way} {row.robot} {row.peer} {row.label}"
                print(f"{told}: {row.difference:.1e} N·m, {row.ratio:.2f} ×", flush=True)
                rows.append(row)
        except (MissingError, RuntimeError) as error:
            lacking.append(f"{peer}. {error}")
            print(f"No {peer}: {error}", flush=True)
    text = report(rows, used, lacking)
    (HERE / "peers.md").write_text(text, encoding="utf-8")
    if rows:
        plot(
            [
                row
                for row in rows
                if row.is_same and row.way == "compiled" and row.peer not in LIMITED
            ]
        )
    print(text)
    raise SystemExit(1 if lacking else 0)


if __name__ == "__main__":
    main()
