"""Command lines whose errors are one line, as those of the programs."""
import argparse
import unicodedata


def plain(text):
    """A text on one line whose characters steer no terminal: each control character is a question mark."""
    return "".join("?" if unicodedata.category(letter) == "Cc" else letter for letter in str(text).replace("\n", " "))


class OneLineParser(argparse.ArgumentParser):
    """An ArgumentParser that does not print its usage before an error."""

    def error(self, message):
        self.exit(2, f"{self.prog.split()[0]}: error: {' '.join(message.split())}; see {self.prog} --help\n")
