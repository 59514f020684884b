"""Limits of accuracy: bounds, other methods, roughness, calibrated uncertainties, traps."""

from matplotlib.figure import Figure

from validation.experiments import baselines as others
from validation.experiments import position_bounds as bounds
from validation.experiments import traps, uncertainty_calibration
from validation.harness.claim import Claim, Effort, Finding, Row, Tell
from validation.metrics.coverage import coverage
from validation.trials.trap_rooms import TRAPS

NO_ANSWER = 1e3  # error that represents a missing position [m]


def position_bounds(effort: Effort, tell: Tell) -> Finding:
    """Compare measured errors with the Cramér-Rao bound and the floor by roughness."""
    chosen = bounds.FULL if effort == "full" else bounds.QUICK
    found: list[bounds.Comparison] = []
    for comparison in bounds.position_bounds(chosen):
        found.append(comparison)
        tell(len(found), chosen.comparisons)
    rows = []
    for sweep in dict.fromkeys(one.sweep for one in found):
        for case in dict.fromkeys(one.case for one in found if one.sweep == sweep):
            some = [
                one
                for one in found
                if (one.sweep, one.case) == (sweep, case) and one.snr_db >= bounds.LEAST_SNR_DB
            ]
            if not some:
                continue
            silent = sum(one.trials - one.answered for one in some)
            rows.append(
                Row(
                    name=f"over {sweep}, {case}: trials without an answer",
                    stated="each is answered",
                    measured=float(silent),
                    high=0.0,
                    origin=f"at {bounds.LEAST_SNR_DB:g} dB and above there is enough to see",
                )
            )
            most = bounds.ESTIMATED_FACTOR if case == "wall estimated" else bounds.FACTOR
            rows.append(
                Row(
                    name=f"over {sweep}, {case}: worst rms error over the bound with its floors",
                    stated="1: an efficient estimator",
                    measured=max(one.ratio for one in some),
                    high=most,
                    origin=f"{most:g} as claimed; {min(one.trials for one in some)} trials each",
                )
            )
            if all(one.closed_form is not None for one in some):
                rows.append(
                    Row(
                        name=f"over {sweep}, {case}: position error bound over that of one wave",
                        stated="1: the same in angle and length, in closed form",
                        measured=max(
                            (one.bound / (one.closed_form or one.bound) for one in some),
                            key=lambda ratio: abs(ratio - 1),
                        ),
                        low=1 - bounds.CLOSED_WITHIN,
                        high=1 + bounds.CLOSED_WITHIN,
                        origin="the pilot falls as 1/f over a band of 29 %: (0.29)²/6 = 1.4 %",
                    )
                )
            if case != "wall estimated":
                rows.append(
                    Row(
                        name=f"over {sweep}, {case}: least",
                        stated="not below 1: it is a bound",
                        measured=min(one.ratio + 4 * one.scatter for one in some),
                        low=1.0,
                        origin="four standard deviations of the trials' rms were added",
                    )
                )

    def draw(figure: Figure) -> None:
        sweeps = list(dict.fromkeys(one.sweep for one in found))
        for ax, sweep in zip(figure.subplots(2, 3).flat, sweeps, strict=False):
            bounds.draw(ax, found, sweep)

    return Finding(rows=rows, draw=draw)


def other_methods(effort: Effort, tell: Tell) -> Finding:
    """Locate the same users by the methods of the thesis' introduction."""
    trials: list[others.Trial] = []
    for trial in others.baselines():
        trials.append(trial)
        tell(len(trials), others.TRIALS)
    found = others.summaries(trials)
    ours = {case: found[others.OURS, case] for case in others.CASES}
    rows = []
    for case, summary in ours.items():
        for what, error, limit in (
            ("median", summary.median, others.MILLIMETRE),
            ("worst", summary.worst, others.MOST),
        ):
            rows.append(
                Row(
                    name=f"ours, {case}: {what} of {summary.trials}",
                    stated="millimetres",
                    measured=1e3 * error,
                    unit="mm",
                    high=1e3 * limit,
                    origin="roughness at places and seeds that nobody chose",
                )
            )
    for (method, case), summary in found.items():
        if method == others.OURS:
            continue
        if case == others.HIDDEN:
            surveyed = method in others.SURVEYED
            error = summary.median if surveyed else summary.within(0.0)
            rows.append(
                Row(
                    name=f"{method}, {case}: {'median' if surveyed else 'best'} error",
                    stated="centimetres to decimetres" if surveyed else "decimetres, or no answer",
                    # A missing position counts as the largest error.
                    measured=1e3 * min(error, NO_ANSWER),
                    unit="mm",
                    low=1e3 * (10 * others.MILLIMETRE if surveyed else others.DECIMETRES),
                    high=3e3 * others.DECIMETRES if surveyed else None,
                    origin="a grid of surveyed places" if surveyed else "the wall is unknown",
                )
            )
        elif case == others.SIGHT and method in others.EXACT_IN_SIGHT:
            rows.append(
                Row(
                    name=f"{method}, {case}: worst error",
                    stated="as good as ours",
                    measured=1e3 * min(summary.worst, NO_ANSWER),
                    unit="mm",
                    high=1e3 * others.MILLIMETRE,
                    origin="so that the comparison is fair: nothing stands in their way",
                )
            )

    def draw(figure: Figure) -> None:
        for ax, case in zip(figure.subplots(1, len(others.CASES)), others.CASES, strict=True):
            others.draw(ax, trials, case)

    return Finding(rows=rows, draw=draw)


def calibration(effort: Effort, tell: Tell) -> Finding:
    """Compare errors with the stated covariances."""
    rows = []
    results = {}
    variants, trials = uncertainty_calibration.VARIANTS, uncertainty_calibration.TRIALS
    for number, (name, variant) in enumerate(variants.items()):
        before = number * trials

        def advance(done: int, count: int, before: int = before) -> None:
            tell(before + done, len(variants) * count)

        found = uncertainty_calibration.calibration(*variant, trials=trials, tell=advance)
        results[name] = found
        rows.append(
            Row(
                name=f"{name}: within the 99.99 % region, of {found.found} answers",
                stated="99.99 %",
                measured=100 * found.held(0.9999),
                unit="%",
                low=98.0,
                origin="no more than a trial in fifty is confidently wrong",
            )
        )
        walls = found.wall_squares
        rows.append(
            Row(
                name=f"{name}: walls within the 95 % region, of {walls.size}",
                stated="95 %",
                measured=100 * coverage(walls, probability=0.95, axes=2).share,
                unit="%",
                low=90.0,
                high=98.0,
                origin="angle and offset together; as asked of users, 200 trials scatter by 1.5 %",
            )
        )
        rows.append(
            Row(
                name=f"{name}: walls within the 99.99 % region, of {walls.size}",
                stated="99.99 %",
                measured=100 * coverage(walls, probability=0.9999, axes=2).share,
                unit="%",
                low=98.0,
                origin="no more than a wall in fifty is confidently wrong",
            )
        )
        if name == "hidden":
            rows.append(
                Row(
                    name=f"{name}: within the 95 % region",
                    stated="95 %",
                    measured=100 * found.held(0.95),
                    unit="%",
                    low=90.0,
                    high=98.0,
                    origin="three deviations of a share of 200 trials (1.5 %) below, two above",
                )
            )

    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, len(results))
        for ax, (name, result) in zip(axes, results.items(), strict=True):
            uncertainty_calibration.draw(ax, name, result)

    return Finding(rows=rows, draw=draw)


def pitfalls(effort: Effort, tell: Tell) -> Finding:
    """Locate users in trap rooms: missing positions are allowed, confidently wrong ones not."""
    wrong: list[str] = []
    answered = 0
    rooms = list(TRAPS.items())
    for number, (name, (scenario, overrides)) in enumerate(rooms):
        result = traps.trial(scenario, overrides, seed=0)
        wrong += [f"{name}: the {what} is wrong" for what in result.wrong]
        answered += result.status == "found"
        tell(number + 1, len(rooms))
    rows = [
        Row(
            name=f"confident wrong answers in {len(rooms)} rooms",
            stated="none: parallel walls, corners, edge-on walls, doorways, posts, users behind",
            measured=float(len(wrong)),
            high=0.0,
            origin="confident: the truth outside the 99.9 % region, or a false mirror above 99 %",
        ),
        Row(
            name=f"users found in {len(rooms)} rooms",
            stated="silence is no answer to everything",
            measured=float(answered),
            low=0.5 * len(rooms),
            origin="half: where a trap leaves enough to see",
        ),
    ]
    return Finding(rows=rows, remarks=tuple(wrong))


CLAIMS = (
    Claim(
        key="position_bounds",
        title="Errors come close to the Cramér-Rao bound, and to the floor of roughness",
        source="Cramér-Rao; physical optics of a rough wall",
        measure=position_bounds,
        minutes=12.0,
    ),
    Claim(
        key="baselines",
        title="Other methods without line of sight, in the same rooms",
        source="the thesis' introduction",
        measure=other_methods,
        quick=False,
        minutes=12.0,
    ),
    Claim(
        key="calibration",
        title="Uncertainties are as large as errors",
        source="χ² of two degrees of freedom",
        measure=calibration,
        quick=False,
        minutes=45.0,
    ),
    Claim(
        key="traps",
        title="No confident wrong answer in rooms that mislead",
        source="the design",
        measure=pitfalls,
        quick=False,
        minutes=10.0,
    ),
)
