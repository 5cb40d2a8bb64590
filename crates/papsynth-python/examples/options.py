"""Command line options of the training scripts."""

import argparse
from pathlib import Path


def number(least, multiple=1):
    """Return a function that parses an integer of at least `least`, a multiple of `multiple`."""

    def parse(text):
        if text.isascii() and text.isdigit() and int(text) >= least and int(text) % multiple == 0:
            return int(text)
        kind = "an integer" if multiple == 1 else f"a multiple of {multiple}"
        raise argparse.ArgumentTypeError(f"{text!r}; expected {kind} of at least {least}")

    return parse


def file(text):
    if not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"{text!r}; expected an existing file")
    return text


def options(description, arguments, steps, batch, weights=False):
    """Return the options of a script; `steps` and `batch` are defaults.

    Scripts with `weights` fine-tune a network, and generate all fields before training; others have `workers`.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=number(1), default=steps, help=f"batches to train on ({steps})")
    parser.add_argument("--batch", type=number(1), default=batch, help=f"fields in a batch ({batch})")
    parser.add_argument("--size", type=number(64, 32), default=256, help="side of a field, pixels (256)")
    if weights:
        parser.add_argument("--weights", type=file, help="weights of a network to fine-tune")
    else:
        parser.add_argument("--workers", type=number(0), default=2, help="processes that generate fields (2)")
    parser.add_argument("--out", help="where to save the network; by default it is not saved")
    return parser.parse_args(arguments)
