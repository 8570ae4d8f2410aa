"""What pMeta's programs share at the command line: one sentence for what is wrong, and exit 1."""

import argparse
import os
import sys

from pmeta_files import PlotError, warnings_to


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise PlotError("%s; see --help." % message)


def run_program(name, body, arguments):
    """Calls body(arguments); returns the exit code."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")

    def say(text):
        print("%s: %s" % (name, text), file=sys.stderr)

    try:
        with warnings_to(lambda text: say("warning: " + text)):
            body(arguments)
        sys.stdout.flush()
    except PlotError as error:
        say(error)
        return 1
    except BrokenPipeError:
        # the reader has seen enough, and every file has been written
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        say("cannot use %s (%s)." % (error.filename or "the output", error.strerror))
        return 1
    return 0
