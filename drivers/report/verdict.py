"""Was the run right? What the log and history.csv say, question by question, from good to bad."""
import re

import numpy
from gravier.run_words import DEEP, LITTLE, OFTEN
from one_line import counted

GOOD, DOUBT, BAD, UNKNOWN = "good", "doubt", "bad", "unknown"
#: as the last words of the program judge: the part of the paths of grains below which their shifts are no fault in any number of steps; the velocity error
#: over U; overlaps, in mean radii, up to which grains are where they should be
NEGLIGIBLE, FAR_OFF, SHALLOW = 1e-3, 0.5, 0.02
#: the question whose answer says nothing of the run
FILES = "Are its files there and whole?"
#: the parts of the sizes of its terms up to which a balance is one, and up to which it is nearly one
BALANCED, UNBALANCED = 1e-4, 1e-2


class Answer:
    """A question, how good the answer is, and the answer in words."""

    def __init__(self, question, grade, text):
        self.question, self.grade, self.text = question, grade, text


def number(keys, name, usual):
    """A value of a group, where it is a number; `usual` else."""
    value = keys.get(name)
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else usual


def percent(share):
    return "none" if share == 0.0 else "less than 1 %" if share < 0.01 else f"{100.0 * share:.0f} %"


def ended(log, history, steps):
    made = int(history.step[-1]) if len(history) > 0 else log.last_step(steps)
    made = f"{'?' if made is None else made} of {'? steps' if steps is None else counted(steps, 'step')}"
    word, text = log.end()
    early = next((f"{begin} {log.value(begin)}" for begin in ("at rest", "ended") if log.value(begin)), None)
    if word == "finished":
        return Answer("Did it come to its end?", GOOD, f"Yes, {early}." if early else f"Yes: {made}.")
    if word:
        return Answer("Did it come to its end?", BAD, f"No, {word}: {text.removeprefix('***').strip()}.")
    return Answer("Did it come to its end?", DOUBT, f"Not so far: the log has no last words. The run goes on, or it was killed. It has made {made}.")


def converged(log, history):
    question = "Did every solve converge?"
    said = log.convergence if log.end()[0] else ""
    if said:
        return Answer(question, BAD if said.startswith("NO") else GOOD, said[0].upper() + said[1:] + ".")
    if "converged" not in history or len(history) == 0:
        return Answer(question, UNKNOWN, "Not known: no solve is recorded.")
    missed = int((history.converged == 0).sum())
    if missed > 0:
        return Answer(question, BAD, f"No: {missed} of {counted(len(history), 'solve')} so far did not.")
    return Answer(question, GOOD, "Yes, the only solve so far." if len(history) == 1 else f"Yes, all {len(history)} solves so far.")


def goals_of(solvers):
    """First steps and accuracies, where they differ from those before; infinite where another criterion ends the solves. `solvers` are the first steps and
    the keys of &solver of the starts of a run."""
    found = []
    for first, solver in solvers:
        goal = number(solver, "accuracy", 0.1) if solver.get("criterion", "velocity_error") == "velocity_error" else numpy.inf
        if not found or goal != found[-1][1]:
            found.append((first, goal))
    return found


def accurate(log, history, solvers):
    """Whether each step has the accuracy that was asked for in it."""
    solver = solvers[-1][1]
    question = "Was the accuracy reached?"
    said = log.largest("accuracy", r"velocity error at most (\d\S*) of U")
    if "velocity_error" not in history or len(history) == 0:
        if not log.value("accuracy"):
            return Answer(question, UNKNOWN, "Not known: no solve is recorded.")
        # the largest of the log stands for those of the steps
        ratio = numpy.array([said])
    else:
        ratio = error_ratio(history)
    if not numpy.isfinite(ratio).any():
        return Answer(question, UNKNOWN, "Not known: no step has an estimate of its velocity error.")
    # history.csv may have a part of the steps, and the log is rounded
    worst = float(numpy.nanmax(ratio))
    worst = said if said > 1.01 * worst else worst
    words = f"the velocity error was at most {worst:.2g} of U, the velocity that a step is judged by"
    if solver.get("criterion", "velocity_error") == "velocity_error":
        goals = goals_of(solvers)
        words += ", with a goal of " + ", ".join(f"{goal:g}" + (f" from step {first} on" if first > 0 else "") for first, goal in goals)
        goal = numpy.full(len(ratio), goals[-1][1])
        for first, value in goals if len(history) > 0 else ():
            goal[history.step >= first] = value
        # the criterion weighs the error, so that the estimate may be a little above
        reached = not (ratio > goal * (1.0 + 1e-6)).any() and said <= 1.01 * max(goal for _, goal in goals)
        if "converged" in history and (history.converged == 0).any():
            missed, above = int((history.converged == 0).sum()), int((ratio > goal)[history.converged == 0].sum())
            beside = "" if above == missed else f", and in {missed - above} more what else the criterion asks for was missed"
            return Answer(question, BAD, f"Not in every step: {words}. It was above this goal in {counted(above, 'step')}{beside}.")
        if log.value("drift"):
            return Answer(question, DOUBT, f"Yes, but the motion may be nothing but errors: {words}; {log.value('drift')}.")
        return Answer(question, GOOD if reached else DOUBT, f"{'Yes' if reached else 'Nearly'}: {words}.")
    grade = GOOD if worst <= 0.1 else DOUBT if worst <= FAR_OFF else BAD
    return Answer(question, grade, f"The criterion '{solver.get('criterion')}' does not bound it; as estimated, {words}.")


def projected(log, history):
    """How often overlaps were projected, and how deep the deepest of the run was."""
    answer = how_often_projected(log, history)
    depth = re.search(r"later at most \S+ m, (\S+) of ([a-z ]+)", log.value("overlaps"))
    if depth and answer.grade != BAD and float(depth[1]) > SHALLOW:
        deep = float(depth[1]) > DEEP
        return Answer(answer.question, BAD if deep else max(answer.grade, DOUBT, key=[GOOD, DOUBT, BAD, UNKNOWN].index),
                      f"{answer.text} It is {'deep' if deep else 'more than is usual'}: {depth[1]} of {depth[2]}. "
                      f"{'Take a smaller step.' if deep else 'Half of the step shows whether the results depend on it.'}")
    return answer


def how_often_projected(log, history):
    """As the log counts projections at its end, which leaves out those that shift by rounding, and weighs them by the paths of grains; of
    steps that it does not know, before its end or before a restart, as history.csv counts them."""
    question = "Were overlaps projected?"
    recorded = "projected" in history and "max_overlap" in history and len(history) > 0
    if not recorded and not log.value("overlaps"):
        return Answer(question, UNKNOWN, "Not known: no step is recorded.")
    largest = log.value("overlaps")
    if recorded:
        deepest, said = history.max_overlap.max(), log.largest("overlaps", r"at most (\d\S*) m")
        largest = f"{said if said > 1.01 * deepest else deepest:.2g} m"
    overlap = f"The largest overlap was {largest}."
    lines = [line.strip() for line in log.lines]
    yielding = next((line for line in lines if line.startswith("compliant contacts are deformed")), None)
    if yielding:
        overlap = f"The largest overlap of rigid contacts was {largest}; {yielding.split(';')[0]}."
    if "overlaps are not projected" in lines:
        return Answer(question, GOOD, f"No: overlaps are not projected in this case. {overlap}")
    told = next((line for line in lines if line.startswith("projected in ")), "")
    found = re.match(r"projected in (\d+) of (\d+) steps", told)
    # of so many steps the log knows the share; of none before its last words
    known = int(found[2]) if found else last_part(log, history) if "no step projected overlaps" in lines else 0
    share = int(found[1]) / max(1, known) if found else 0.0
    small = re.search(r", (\S+) of its path", told)
    grade = GOOD if share == 0.0 else BAD if share > OFTEN else DOUBT
    if small and float(small[1]) < LITTLE:
        grade = DOUBT if share > OFTEN and float(small[1]) >= NEGLIGIBLE else GOOD
    words = [told] if told else []
    # what came before the log: how far grains were shifted then is not known
    before = history.projected[history.step <= history.step[-1] - known] if recorded else numpy.zeros(0)
    if (before > 0).any():
        grade = BAD if grade == BAD else DOUBT
        part = percent(float((before > 0).mean()))
        words.append(f"projected in {part} of the steps" if known == 0 else f"before the restart, projected in {part} of {counted(len(before), 'step')}")
    if not words:
        return Answer(question, GOOD, f"No step projected overlaps. {overlap}")
    often = share > OFTEN or (len(before) > 0 and float((before > 0).mean()) > OFTEN)
    how = "Yes, often" if often and grade != GOOD else "Often, but by too little to matter" if often else "A little"
    return Answer(question, grade, f"{how}: {'; '.join(words)}. {overlap}")


def last_part(log, history):
    """Steps since the last restart, which the log names by the step of its checkpoint; all of them without one."""
    found = re.match(r"from the checkpoint of step (\d+)", log.value("restart"))
    return int((history.step > int(found[1])).sum()) if found and len(history) > 0 else len(history)


def too_fast(history):
    """Whether something went too far in a step to be seen by what it passed."""
    if "fast" not in history or not (history.fast > 0).any():
        return []
    times, steps = counted(int(history.fast.sum()), "time"), counted(int((history.fast > 0).sum()), "step")
    return [Answer("Was the step short enough?", DOUBT, f"Not always: {times} something moved by more than half of its thickness in a step, in {steps}. "
                   "It may have passed through others.")]


def doubted(log):
    """What else the last words doubt: what has no question of its own."""
    left = [part for part in log.doubts.split("; ") if part and not re.match(r"overlaps |\d+ times something moved|velocities were wrong", part)]
    return [Answer("Do the last words doubt anything else?", DOUBT, f"Yes: {'; '.join(left)}.")] if left else []


def balanced(log):
    said = log.value("energy")
    found = re.match(r"balance off by (\S+) J(?:; the sizes of its terms sum up to|, of) (\S+) J", said)
    if not found:
        return []
    off, terms = (float(text) for text in found.groups())
    grade = GOOD if off <= BALANCED * terms else DOUBT if off <= UNBALANCED * terms else BAD
    since = " These are the energies since the last restart." if log.restarts > 0 else ""
    return [Answer("Do the energies balance?", grade, said[0].upper() + said[1:] + "." + since)]


def readable(notes):
    return [Answer(FILES, BAD, f"Not all: {' '.join(notes)}")] if notes else []


def error_ratio(history):
    """Velocity error over U of each step; NaN where one is not known."""
    scale = history.velocity_scale if "velocity_scale" in history else numpy.zeros(len(history))
    ratio = numpy.divide(history.velocity_error, scale, out=numpy.full(len(history), numpy.nan), where=scale > 0.0)
    return numpy.where(ratio < 1e6, ratio, numpy.nan)


def answers(log, history, options, notes, solvers):
    """Answers to all questions of a run; `notes` name files that are missing or damaged, `solvers` are the first steps and the keys of &solver of its
    starts."""
    steps = (options.get("time") or [{}])[0].get("steps")
    return [ended(log, history, steps), converged(log, history), accurate(log, history, solvers), projected(log, history), *too_fast(history), *doubted(log),
            *balanced(log), *readable(notes)]


def headline(found, log):
    """The grade of the whole, and a sentence."""
    grades = [answer.grade for answer in found]
    word, _ = log.end()
    if not word:
        return (BAD if BAD in grades else DOUBT), "This run has not come to its end."
    if word != "finished":
        return BAD, "This run did not come to its end."
    if BAD in [answer.grade for answer in found if answer.question != FILES]:
        return BAD, "This run ended, but its results are not what was asked for."
    if BAD in grades:
        return BAD, "This run ended, but not all of its files are there and whole."
    if DOUBT in grades:
        return DOUBT, "This run ended; mind what is marked below."
    return GOOD, "This run converged, with the accuracy that was asked for."
