"""What run.log says of convergence and of doubts, over all starts of a run."""
import re

VERDICTS = {"yes": "converged", "NO": "not converged"}
#: as the last words of the program judge: the fraction of steps with projected overlaps, the part of the paths of grains below which shifts are small, and
#: overlaps, in mean radii, beyond which grains are in each other
OFTEN, LITTLE, DEEP = 0.1, 0.01, 0.1
#: parts of the last words that raise no doubt: projections that shift grains by a little of their paths, and what the words are of
HARMLESS = re.compile(r"overlaps were projected in .* of the paths of grains(, which is too little to matter)?$|errors and overlaps are those since the restart$")


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
        found += _doubts_before_interruption(lines)
        found += [part.replace(" of them", " of the steps") for part in parts if not HARMLESS.match(part)]
    return "; ".join(dict.fromkeys(found))


def _doubts_before_interruption(lines):
    """Of a start without last words, which has ended by a limit of time or a signal: its projected and its large overlaps. What else there is to doubt,
    checkpoints keep."""
    if not said_of(lines, "interrupted"):
        return []
    found = []
    often = re.search(r"\n +projected in (\d+) of (\d+) steps .*, (\S+) of its path", "\n".join(["", *lines]))
    if often and int(often[1]) > OFTEN * int(often[2]) and float(often[3]) >= LITTLE:
        found.append(f"overlaps were projected in {100.0 * int(often[1]) / int(often[2]):.0f} % of the {often[2]} steps before an interruption: the results are not those of the "
                     "contact law")
    depth = re.search(r"later at most \S+ m, (\S+) of ([a-z ]+)", said_of(lines, "overlaps"))
    if depth and float(depth[1]) > DEEP:
        found.append(f"overlaps came to {float(depth[1]):g} of {depth[2]}")
    return found


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
