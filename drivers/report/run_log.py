"""What run.log says, in parts: the head, the keys in force, warnings, the table of phases, the last words, and how the run ended."""
import re

import gravier
from gravier.run_words import convergence, doubts, said_of, starts_of

#: exit statuses as the program documents them
STATUSES = {0: "done, every solve converged", 3: "a solve did not converge", 4: "the run was interrupted, or an error ended it"}
#: lines with which the part begins that a run writes at its end
CLOSING = ("phase  ", "stopped ", "lost ", "interrupted ")
#: first words of the last line of a run that has ended
ENDS = ("finished", "stopped", "lost", "interrupted")


class RunLog:
    """The log of a run; after restarts, the part since the last one and the number of them."""

    def __init__(self, text):
        starts = starts_of(text)
        self.restarts, self.lines, self._starts = len(starts) - 1, starts[-1], starts
        #: what the log says of convergence over all starts
        self.convergence = convergence(text)
        #: what the last words of all starts doubt
        self.doubts = doubts(text)

    def value(self, word):
        """What follows the last line that begins with a word; empty where there is none."""
        return said_of(self.lines, word)

    def largest(self, word, pattern):
        """The largest of the numbers that a pattern finds in the last lines of all starts that begin with a word; 0 where there are none. history.csv may
        not have the step of such a number among its rows."""
        return max((float(found) for lines in self._starts for found in re.findall(pattern, said_of(lines, word))), default=0.0)

    def version(self):
        """The program and the libraries, a line each."""
        return self.lines[:2] if self.lines and self.lines[0].startswith("Gravier ") else []

    def options(self):
        """Keys in force, {group: [{key: value}, ...]}."""
        inside = [line for line in self.lines if line.startswith("  ") and not line.startswith("  ***")]
        first = next((k for k, line in enumerate(inside) if line.startswith("  &")), len(inside))
        last = max((k for k, line in enumerate(inside) if line == "  /"), default=first - 1)
        return gravier.parse_namelist("\n".join(inside[first:last + 1]))

    def is_idle(self):
        """Whether this is the log of a restart that had no step left to make."""
        return any(line.startswith("warning     no step is left to make") for line in self.lines)

    def warnings(self):
        """Lines that warn, what the closing line counts, with misses of solves, and what a loop has set in the place of keys."""
        return [line.strip() for line in self.lines if line.startswith(("warning ", "loop ")) or line.lstrip().startswith("***")]

    def phases(self):
        """Name, mean, least and largest time over the ranks [s] and percentage of the run, the dearest first."""
        rows = [re.match(r"(\S.{27})\s*([\d.]+)\s+([\d.]+)\s+([\d.]+)\s+([\d.]+) %$", line) for line in self.lines]
        found = [(row[1].strip(), *(float(row[k]) for k in range(2, 6))) for row in rows if row]
        return sorted(found, key=lambda row: -row[1])

    def seconds(self):
        """Wall time of the run [s]; None where it did not come to its end."""
        found = self.value("whole run")
        return float(found) if re.fullmatch(r"[\d.]+", found) else None

    def last_words(self, most=26):
        """What the log ends with, as it is: the words after the table of phases, or the last lines of a log without one."""
        first = max((k for k, line in enumerate(self.lines) if line.startswith(CLOSING)), default=None)
        if first is None:
            return self.lines[-8:]
        told = [line for line in self.lines[first:] if not re.match(r"\S.{27}\s*[\d.]+(\s+[\d.]+)*( %)?$|phase  ", line)]
        return told[-most:]

    def end(self):
        """First word of the last line of a run that has ended, and that line; empty where it has not."""
        for line in reversed(self.lines):
            word = line.split(" ", 1)[0]
            if word in ENDS:
                return word, line[len(word):].strip()
        return "", ""

    def last_step(self, steps):
        """The step with which a run has ended, of which its case asks for `steps`; None where the log has no last words, or they do not tell."""
        word, text = self.end()
        for said in (self.value("at rest"), self.value("ended"), text):
            found = re.search(r"\bafter (?:step )?(\d+)", said)
            if found:
                return int(found[1])
        # a step that diverges is not kept, and is the last one
        diverged = next((re.search(r"\*\*\* DIVERGED: step (\d+)", line) for line in self.lines if "*** DIVERGED: step " in line), None)
        if diverged:
            return int(diverged[1]) - 1
        return steps if word == "finished" else None

    def status(self):
        """The exit status that these words belong to; None of a run without an end."""
        word, text = self.end()
        if word == "finished":
            return 3 if text.startswith("***") else 0
        return 4 if word else None
