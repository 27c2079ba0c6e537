"""What run.log says of convergence and of doubts, over all starts of a run."""
import re

VERDICTS = {"yes": "converged", "NO": "not converged"}
#: parts of the last words that raise no doubt: projections that shift grains by a little of their paths, and what the words are of
HARMLESS = re.compile(r"overlaps were projected in .* of the paths of grains$|errors and overlaps are those since the restart$")


def starts_of(text):
    """The parts of a log, a list of lines each: that of the first start, and those of the restarts."""
    parts = re.split(r"^(?=Gravier \S+ \()", text, flags=re.M)
    return [part.splitlines() for part in parts[1:]] or [text.splitlines()]


def said_of(lines, word):
    """What follows the last line that begins with a word; empty where there is none."""
    return next((line[len(word):].strip() for line in reversed(lines) if re.match(rf"{re.escape(word)}\s", line)), "")


def convergence(text):
    """What the line `converged` says of a run: that of the last start with steps, unless an earlier one had doubts that the counts of misses, which
    checkpoints keep, do not tell: spot checks that refute it, or another criterion than the velocity error. Empty where no start says it."""
    said = [said for said in (said_of(lines, "converged") for lines in starts_of(text)) if said]
    doubts = [one for one in said if one.startswith("only by") or one.startswith("NO") and "spot checks" in one]
    worst = next((one for one in [*said[-1:], *reversed(doubts)] if one.startswith("NO")), None)
    return worst or (doubts or said or [""])[-1]


def doubts(text):
    """What makes the results less than the begin of the last words says: large errors of velocities, overlaps, grains too fast for the step, drift, fallen
    grains; of all starts, as the lines `finished` have it. Empty where there is nothing of the kind."""
    found = []
    for lines in starts_of(text):
        _, *parts = re.split(r"; |, but ", said_of(lines, "finished").rpartition("; results in ")[0])
        found += [part.replace(" of them", " of the steps") for part in parts if not HARMLESS.match(part)]
    return "; ".join(dict.fromkeys(found))


def verdict(text):
    """'converged', 'converged with doubts', 'not converged', 'converged only by' or 'not finished': of a whole log."""
    last = said_of(starts_of(text)[-1], "finished")
    if not last:
        return "not finished"
    if last.startswith("***"):
        return "not converged"
    said = convergence(text)
    # without a step there is nothing to say
    found = VERDICTS.get(said.split(":")[0], "converged only by") if said else "converged"
    return "converged with doubts" if found == "converged" and doubts(text) else found
