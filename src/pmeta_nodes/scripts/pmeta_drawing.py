"""What every figure of pMeta shares: colours, style, panels, legends, and the files written."""

import functools
import os
import re
import textwrap

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib import font_manager
from matplotlib.text import Text

from pmeta_files import warn

# Okabe and Ito's colours, told apart by colour-blind readers as well
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, BLACK, GREY = "#CC79A7", "#56B4E9", "#000000", "#666666"
PALETTE = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY, BLACK)
BROWN, VIOLET, OLIVE = "#8C510A", "#5E3C99", "#8A8D00"
# a method keeps its own in every figure; lines and marks tell them apart in grey
BASELINE_STYLES = tuple(
    {"color": color, "linestyle": line, "marker": marker} for color, line, marker in (
        (GREEN, "--", "^"), (ORANGE, "-.", "D"), (PURPLE, (0, (5, 1)), "v"),
        (BROWN, (0, (3, 1.2, 1, 1.2)), "P"), (BLACK, (0, (6, 1.5)), "X"), (VIOLET, (0, (2, 1)), "<"),
        (OLIVE, (0, (4, 1, 1, 1, 1, 1)), ">"), (RED, (0, (8, 2, 2, 2)), "p")))
# personal policies and the meta-policy, as rviz shows them (scene_parts.h); far apart for
# colour-blind readers, too, and in grey
PP_COLOR, MP_COLOR = "#D81B60", "#0B4FB3"
STYLE = {
    "font.size": 10, "axes.titlesize": 10.5, "axes.labelsize": 10, "legend.fontsize": 9.5,
    "xtick.labelsize": 9.5, "ytick.labelsize": 9.5, "axes.grid": True, "grid.linewidth": 0.4,
    "grid.color": "#cccccc", "axes.axisbelow": True, "axes.spines.top": False,
    "axes.spines.right": False, "axes.linewidth": 0.8, "lines.linewidth": 1.7,
    "lines.markersize": 4.5, "legend.frameon": False, "savefig.dpi": 150, "pdf.fonttype": 42,
}


def style():
    return plt.rc_context(STYLE)


def baseline_style(place):
    """Of the place of its algorithm among all, which is 1 or more for a baseline."""
    return BASELINE_STYLES[(place - 1) % len(BASELINE_STYLES)]


class Figures:
    """Writes figures into one folder and remembers what it wrote."""

    def __init__(self, out, formats):
        self.out = out
        self.formats = formats
        self.written = []

    def save(self, figure, name):
        """Writes and closes the figure; `name` may lie in a folder below `out`."""
        finish(figure)
        os.makedirs(os.path.dirname(os.path.join(self.out, name)), exist_ok=True)
        for extension in self.formats:
            path = os.path.join(self.out, name + "." + extension)
            # no date in the file: the same runs give the same bytes
            figure.savefig(path, metadata={"CreationDate": None} if extension == "pdf" else None)
            self.written.append(path)
        plt.close(figure)

    def write(self, text, name):
        """Writes a table that belongs to the figures."""
        path = os.path.join(self.out, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        self.written.append(path)


@functools.lru_cache(maxsize=None)
def _font():
    return font_manager.get_font(font_manager.findfont("DejaVu Sans"))


@functools.lru_cache(maxsize=None)
def plain(text):
    """Text as it is to be drawn: no formula in it, and a box for a letter that the font lacks."""
    known = "".join(c if c.isspace() or _font().get_char_index(ord(c)) else "\u25a1" for c in text)
    if known != text:
        warn("the font of the figures lacks letters of '%s': they are drawn as boxes." % text)
    return re.sub(r"(?<!\\)\$", r"\\$", known)


def finish(figure):
    """What all texts of a figure need; those of ticks come from formatters, see wrapped_name."""
    for axis in figure.axes:
        axis.yaxis.label.set_multialignment("center")
    for text in figure.findobj(Text):
        if text.get_text() != plain(text.get_text()):
            text.set_text(plain(text.get_text()))


def folder_for(name, names):
    """Where the figures of one of several experiments lie; of a single one, in no folder."""
    return name + os.sep if len(names) > 1 else ""


def panels(rows, columns, sharey=True, panel_width=None):
    """Axes rows x columns; unless their width is given, with room for a legend on the right."""
    width = 3.3 * columns + 2.6 if columns > 1 else 7.2
    if panel_width is not None:
        width = panel_width * columns
    return plt.subplots(rows, columns, squeeze=False, sharey=sharey,
                        figsize=(width, 3.4 * rows + 0.3), constrained_layout=True)


def legend_right(axes, inside=False):
    """One legend for all panels of a row, beside the last, or in its place where it is empty."""
    entries = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels()):
            entries.setdefault(label, handle)
    axes[-1].legend(list(entries.values()), list(entries), loc="center left",
                    bbox_to_anchor=(0 if inside else 1.02, 0.5), borderaxespad=0, handlelength=2.6,
                    ncol=1 + len(entries) // 16)


def headline(figure, text):
    figure.suptitle(text, x=0.01, ha="left", fontsize=11)


# a blank after a comma or colon, but not within brackets: coordinates stay together
BETWEEN = re.compile(r"(?<=[,:]) (?![^(\[]*[)\]])")


def wrapped_name(name, width=34):
    """A task's name in short lines, which end between two of its properties, not within one."""
    parts = BETWEEN.split(name)
    lines = textwrap.fill(" ".join(part.replace(" ", "\u00a0") for part in parts), width,
                          break_on_hyphens=False, break_long_words=False)
    return plain(lines)


def row_height(labels, least):
    """Inches of a row that has one of these labels, of small letters, before it."""
    return max(least, 0.06 + 0.15 * max(label.count("\n") + 1 for label in labels))


def spread_ticks(axis, values):
    """The values themselves as ticks, without those that would touch."""
    place = np.log(values) if axis.get_xscale() == "log" else values
    gap = 0.035 * (max(len("%g" % v) for v in values) + 0.7) * (place.max() - place.min())
    ticks, last = [], -np.inf
    for value, x in zip(values, place):
        if x - last >= gap:
            ticks.append(value)
            last = x
    return ticks
