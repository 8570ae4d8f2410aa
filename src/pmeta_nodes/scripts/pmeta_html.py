"""Pieces of a self-contained HTML page: no script, nothing from the network, figures inside."""

import base64
import html
import io
import os
import urllib.parse

import matplotlib.pyplot as plt

from pmeta_drawing import Figures, finish

STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --line: #d0d7de;
  --back: #ffffff; --band: #f3f5f8; --link: #005a9c; --note: #fff4d6; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ed; --soft: #a2abb6; --line: #3c444d;
  --back: #14181d; --band: #1e242b; --link: #7cc0ff; --note: #40361a; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 74rem; padding: 1rem 1.2rem 3rem; background: var(--back);
  color: var(--ink); font: 1rem/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: .6rem 0 .3rem; }
h2 { font-size: 1.3rem; margin: 2.2rem 0 .6rem; padding-top: .8rem;
  border-top: 2px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.6rem 0 .4rem; }
p { margin: .4rem 0; max-width: 46rem; }
.soft, figcaption, caption { color: var(--soft); font-size: .9rem; }
a { color: var(--link); }
.note { background: var(--note); padding: .5rem .8rem; border-radius: .4rem; max-width: none;
  overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.2rem; margin: .6rem 0; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
.scroll { overflow-x: auto; margin: .4rem 0; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .7rem; text-align: right; white-space: nowrap;
  border-bottom: 1px solid var(--line); }
th { border-bottom: 2px solid var(--line); font-weight: 600; }
.words { text-align: left; }
th:first-child, td:first-child { position: sticky; left: 0; background: var(--back);
  padding-left: 0; }
figure { margin: 1rem 0 1.6rem; }
figure img { display: block; max-width: 100%; height: auto; background: #fff;
  border-radius: .4rem; }
details { margin: .5rem 0; } summary { cursor: pointer; color: var(--link); }
pre { background: var(--band); padding: .7rem .9rem; border-radius: .4rem; overflow-x: auto;
  font: .85rem/1.4 ui-monospace, "DejaVu Sans Mono", monospace; }
@media (max-width: 46rem) {
  body { padding: .6rem .8rem 2rem; }
  dl { grid-template-columns: 1fr; gap: 0; } dd { margin-bottom: .4rem; }
  table { font-size: .85rem; } th, td { padding: .3rem .5rem; }
  th:first-child, td:first-child { white-space: normal; min-width: 6.5rem; }
  /* a wide figure shrunk to a phone cannot be read: it scrolls */
  figure img { max-width: none; width: max(100%, 40rem); }
}
@media (prefers-color-scheme: dark) { figure img { filter: brightness(.9); } }
@media print {
  :root { color-scheme: light; --ink: #000; --soft: #333; --line: #999; --back: #fff;
    --band: #fff; --link: #000; --note: #fff; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  figure, tr { break-inside: avoid; } h2, h3 { break-after: avoid; }
  .scroll { overflow: visible; } table { font-size: 8pt; } th, td { padding: .15rem .35rem; }
  th:first-child, td:first-child { position: static; }
  figure img { width: auto; max-width: 100%; max-height: 24cm; filter: none; }
  pre { white-space: pre-wrap; font-size: 7.5pt; }
}
"""


RASTER_DPI = 110  # of the value maps: at 150 they are most of the file
CAPTIONS = (
    ("learning_curves", "Learning curves: the return after every round."),
    ("_curves", "Learning curves for every value of %s."),
    ("sweep_", "Return against %s."),
    ("comparison_unseen", "The meta-policies of all methods on test tasks, before adaptation and "
     "after it; dotted: the mean of the last tenth of the evaluations."),
    ("comparison", "All methods beside ours on training tasks; dotted: the mean of the last tenth "
     "of the evaluations."),
    ("tasks_last", "Returns task by task; a task that is stuck shows, which a mean hides."),
    ("_unseen_tasks", "The meta-policy on training tasks and on test tasks, before and after "
     "adaptation from exploration episodes, as far as there are any."),
    ("trajectories", "One episode of each policy on each task: of personal policies on their own, of "
     "meta-policies after so many exploration episodes. Full lines end within the goal's radius."),
    ("value_maps", "What each policy takes a state to be worth (colour), and greedy episodes from "
     "three starts at rest (lines; the titles count their steps). Optimal: value iteration."),
    ("action_values", "What each policy takes its first action to be worth (colour, from each "
     "map's lowest to its highest value), and the action it takes."),
    ("convergence_", "Measured beside the theory: %s."),
)


class InlineFigures(Figures):
    """Keeps figures as HTML instead of writing them; tables beside them are dropped."""

    def __init__(self):
        super().__init__("", ())

    def save(self, figure, name):
        finish(figure)
        data = io.BytesIO()
        # no date and no random names inside: the same runs give the same bytes
        with plt.rc_context({"svg.hashsalt": "pmeta"}):
            figure.savefig(data, format="svg", dpi=RASTER_DPI, metadata={"Date": None})
        title = figure._suptitle.get_text().replace("\\$", "$")
        uri = "data:image/svg+xml;base64," + base64.b64encode(data.getvalue()).decode("ascii")
        width, height = figure.get_size_inches() * 96
        self.written.append(
            '<figure><div class="scroll"><img alt="%s" width="%d" height="%d" src="%s"></div>'
            '<figcaption>%s</figcaption></figure>'
            % (text(title), round(width), round(height), uri, text(caption_of(name))))
        plt.close(figure)

    def write(self, text, name):
        pass


def caption_of(name):
    """What a figure shows, by its file name."""
    stem = os.path.basename(name)
    for part, caption in CAPTIONS:
        if part in stem:
            return caption.replace("%s", stem.replace(part, "").replace("_", " "))
    return stem.replace("_", " ")


def text(value):
    return html.escape(str(value))


def page(title, body):
    return "\n".join([
        "<!DOCTYPE html>", '<html lang="en">', "<head>", '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        "<title>%s</title>" % text(title), "<style>%s</style>" % STYLE, "</head>", "<body>",
        "<h1>%s</h1>" % text(title)] + body + ["</body>", "</html>"]) + "\n"


def heading(level, words):
    return "<h%d>%s</h%d>" % (level, text(words), level)


def paragraph(words, kind="soft"):
    return '<p class="%s">%s</p>' % (kind, text(words))


def facts(pairs):
    """A list of names and values; values are HTML."""
    return "<dl>%s</dl>" % "".join("<dt>%s</dt><dd>%s</dd>" % (text(name), value)
                                   for name, value in pairs)


def table(heads, lines, words=1, caption=None):
    """Cells are HTML; the first `words` columns are words, the others numbers."""
    def row(tag, cells):
        return "<tr>%s</tr>" % "".join(
            "<%s%s>%s</%s>" % (tag, ' class="words"' if i < words else "", cell, tag)
            for i, cell in enumerate(cells))

    return '<div class="scroll"><table>%s<thead>%s</thead><tbody>%s</tbody></table></div>' % (
        "<caption>%s</caption>" % text(caption) if caption else "", row("th", heads),
        "".join(row("td", line) for line in lines))


def details(summary, content):
    return "<details><summary>%s</summary>%s</details>" % (text(summary), content)


def preformatted(words):
    return "<pre>%s</pre>" % text(words)


def link(path, folder, words):
    """A link to a file, relative to the folder that the page lies in."""
    relative = os.path.relpath(path, folder or ".").replace(os.sep, "/")
    # "./" keeps a name with a colon from being read as a scheme
    return '<a href="./%s">%s</a>' % (urllib.parse.quote(relative), text(words))
