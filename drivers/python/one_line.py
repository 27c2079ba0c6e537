"""Command lines whose errors are one line, as those of the programs."""
import argparse


class OneLineParser(argparse.ArgumentParser):
    """An ArgumentParser that does not print its usage before an error."""

    def error(self, message):
        self.exit(2, f"{self.prog.split()[0]}: error: {' '.join(message.split())}; see {self.prog} --help\n")
