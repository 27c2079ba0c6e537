"""Command lines whose errors are one line, as those of the programs, and tools that end in an orderly way."""
import argparse
import math
import os
import re
import signal
import sys
import unicodedata


#: what begins with a minus and is a number; a parser takes -1e-3 for an option unless its `_negative_number_matcher` is this
NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")


def plain(text):
    """A text on one line whose characters steer no terminal: each control character is a question mark."""
    return "".join("?" if unicodedata.category(letter) == "Cc" else letter for letter in str(text).replace("\n", " "))


def counted(number, word):
    """A number with its word: 1 step, 2 steps."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


class OneLineParser(argparse.ArgumentParser):
    """An ArgumentParser that does not print its usage before an error."""

    def error(self, message):
        self.exit(2, f"{self.prog.split()[0]}: error: {' '.join(message.split())}; see {self.prog} --help\n")


def whole(least):
    """The type of an option that is an integer of at least so much."""
    def read(text):
        try:
            number = int(text)
        except ValueError:
            number = least - 1
        if number < least:
            raise argparse.ArgumentTypeError(f"'{plain(text)}': expected an integer >= {least}")
        return number
    return read


def positive(text):
    """The type of an option that is a number above 0."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"'{plain(text)}': expected a number > 0")
    return number


def length(text):
    """The type of an option that is a length above 0, in metres or with the unit mm or um behind it."""
    number, unit = re.fullmatch(r"(.*?)(mm|um|m)?", text, re.S).groups()
    try:
        return positive(number) * {"mm": 1e-3, "um": 1e-6}.get(unit, 1.0)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"'{plain(text)}': expected a number > 0, with the unit m, mm or um or without one") from None


def finite(text):
    """The type of an option that is a finite number."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"'{plain(text)}': expected a number")
    return number


def steps_of(text):
    """`all`, or numbers of steps and ranges FIRST:LAST with commas between, as `steps_in` of a run takes them; an end may be left out."""
    if text == "all":
        return text
    parts = text.split(",")
    if not all(re.fullmatch(r"\d+|\d*:\d*", part) for part in parts):
        raise argparse.ArgumentTypeError(f"'{plain(text)}': expected all, or steps and ranges of them such as 100,5000:8000")
    return [tuple(int(end) if end else None for end in part.split(":")) if ":" in part else int(part) for part in parts]


def run_tool(main):
    """Run a tool and exit with the status that `main` returns. SIGTERM ends it as sys.exit does, with status 143, so that it takes its drafts
    away; ^C ends it with 130, and a reader of its output who has seen enough, as `head`, with 141: both without a traceback."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        try:
            status = main()
        finally:
            # not only at the end of the interpreter, which nothing could catch
            sys.stdout.flush()
        sys.exit(status)
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    except BrokenPipeError:
        # what is left to write goes nowhere, at the end of the interpreter as well
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(128 + signal.SIGPIPE)
