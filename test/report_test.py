"""Tests of `pmeta report`: what Chromium makes of the page, against the CSV files' own numbers."""

import html.parser
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import urllib.parse

import pytest

from run_folders import call, curve, edit, fails, fresh_mean, write_run
import report as program

needs_chromium = pytest.mark.skipif(not shutil.which("chromium"), reason="no chromium here")
LOOK = """<script>addEventListener("load", () => {
  const root = document.documentElement, style = getComputedStyle(document.body);
  const cells = row => [...row.children].map(cell => cell.innerText);
  const found = {
    images: [...document.images].map(i => [i.complete, i.naturalWidth, i.naturalHeight]),
    tables: [...document.querySelectorAll("table")].map(t => [...t.rows].map(cells)),
    fetched: performance.getEntriesByType("resource").map(e => e.name),
    overflow: root.scrollWidth - root.clientWidth,
    colours: [style.color, style.backgroundColor]
  };
  document.body.innerHTML = "";
  document.body.append("FOUND" + JSON.stringify(found) + "END");
});</script>"""


def report(*arguments, code=0):
    return call(program.main, *arguments, code=code)


def refuses(*arguments):
    return fails(*arguments, main=program.main, name="report")


def look(path, width=1280, dark=False):
    """What a headless Chromium finds in the page."""
    folder = os.path.dirname(str(path))
    copy = os.path.join(folder, "looked_at.html")
    with open(str(path), encoding="utf-8") as file:
        text = file.read()
    with open(copy, "w", encoding="utf-8") as file:
        file.write(text.replace("</head>", LOOK + "</head>").replace("<details>", "<details open>"))
    result = subprocess.run(
        ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
         "--user-data-dir=" + os.path.join(folder, "chromium"), "--window-size=%d,900" % width,
         "--blink-settings=preferredColorScheme=%d" % (0 if dark else 1), "--dump-dom",
         "file://" + urllib.parse.quote(copy)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=120)
    dom = result.stdout.decode("utf-8")
    assert "FOUND" in dom, result.stderr.decode("utf-8", "replace")
    return json.loads(html.unescape(dom[dom.rindex("FOUND") + 5:dom.rindex("END")]))


class Page(html.parser.HTMLParser):
    """Tags and addresses of a page, without a browser."""

    def __init__(self, path):
        super().__init__()
        self.tags, self.addresses = [], []
        with open(str(path), encoding="utf-8") as file:
            self.text = file.read()
        self.feed(self.text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.addresses += [value for key, value in attributes
                           if key in ("src", "href", "srcset", "action", "data", "poster")]


@pytest.fixture(scope="module")
def top(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def folders(top):
    """{algorithm: [folder of seed 0, 1, 2]} of runs with networks and fresh episodes."""
    return {name: [write_run(top, name, seed, 20, experiment="mountain_car", learner="dqn",
                             fresh=100, updates=3750) for seed in range(3)]
            for name in ("pmeta", "model_averaging", "independent")}


@pytest.fixture(scope="module")
def written(top, folders):
    path = top / "page" / "all runs.html"
    out, err = report(top, "-o", path)
    assert out == "wrote %s\n" % path and err == ""
    return path


def spread(values):
    return "%.2f ± %.2f" % (statistics.mean(values), statistics.stdev(values))


@needs_chromium
def test_tables_show_the_numbers_of_the_csv_files(folders, written):
    best, learning, iqm, compared, tasks, runs = look(written)["tables"]
    assert iqm[0][:3] == ["group", "IQM of", "seeds"] and compared[0][-1] == "P(improvement)"
    assert best[0] == ["group", "policy", "best", "last", "fresh (best)", "fresh (last)",
                       "paper, λ", "paper, best"]
    assert [row[:2] for row in best[1:]] == [
        ["pMeta-RL λ=20", "PP"], ["", "MP"], ["model averaging", "PP"], ["", "MP"],
        ["independent", "PP (DQN*)"], ["", "all (DQN)"]]
    lines = iter(best[1:])
    for algorithm, policies in (("pmeta", ("personal", "meta")),
                                ("model_averaging", ("personal", "meta")),
                                ("independent", ("personal",))):
        for policy in policies:
            curves = [curve(folder, policy) for folder in folders[algorithm]]
            assert next(lines)[2:6] == [
                spread([max(c) for c in curves]), spread([c[-1] for c in curves]),
                spread([fresh_mean(f, "best", policy) for f in folders[algorithm]]),
                spread([fresh_mean(f, "last", policy) for f in folders[algorithm]])]
    assert next(lines)[2:6] == ["-", "-"] + [
        spread([fresh_mean(f, snapshot, "personal", own=False) for f in folders["independent"]])
        for snapshot in ("best", "last")]
    assert [row[6:] for row in best[1:3]] == [["-92.13 ± 0.95", "-93.05 ± 0.95"],
                                              ["-107.08 ± 3.21", "-107.15 ± 4.10"]]

    assert learning[1][4] == spread([statistics.mean(curve(f, "personal"))
                                     for f in folders["pmeta"]])
    assert tasks[0] == ["group", "policy", "round", "episodes", "task 0", "task 1"]
    [last] = [row for row in tasks[1:5] if row[1:4] == ["MP", "last", "fresh"]]
    values = []
    for folder in folders["pmeta"]:
        with open(os.path.join(folder, "final.csv")) as file:
            values += [float(line.split(",")[6]) for line in file
                       if line.startswith("last,3,meta,-1,1,")]
    assert len(values) == 3 and last[5] == spread(values)
    assert len(runs) == 1 + 9


@needs_chromium
@pytest.mark.parametrize("width", [500, 1280])
def test_figures_decode_and_the_page_fits_its_window(written, width):
    found = look(written, width)
    assert len(found["images"]) == 2
    assert all(complete and w > 300 and h > 150 for complete, w, h in found["images"])
    assert found["overflow"] <= 0
    assert [name for name in found["fetched"] if not name.startswith("data:")] == []


@needs_chromium
def test_the_page_follows_the_colour_scheme(written):
    light, dark = look(written), look(written, dark=True)
    assert light["colours"] == ["rgb(27, 31, 36)", "rgb(255, 255, 255)"]
    assert dark["colours"] == ["rgb(230, 233, 237)", "rgb(20, 24, 29)"]


def test_nothing_comes_from_elsewhere(folders, written):
    page = Page(written)
    assert not {"script", "link", "iframe", "object", "embed", "base"} & set(page.tags)
    assert not re.search(r"url\(|@import", page.text)
    assert "viewport" in page.text and page.tags.count("img") == 2
    files = [a for a in page.addresses if not a.startswith("data:image/svg+xml;base64,")]
    assert len(page.addresses) - len(files) == 2
    # relative links, and each leads to what it names
    assert len(files) == 9 * 5
    for address in files:
        assert address.startswith("./")
        assert os.path.exists(os.path.join(os.path.dirname(str(written)),
                                           urllib.parse.unquote(address)))
    csv = [os.path.realpath(os.path.join(os.path.dirname(str(written)), urllib.parse.unquote(a)))
           for a in files if a.endswith("final.csv")]
    assert sorted(csv) == sorted(os.path.realpath(os.path.join(f, "final.csv"))
                                 for members in folders.values() for f in members)


def test_the_page_says_what_was_run(folders, written):
    text = Page(written).text
    with open(os.path.join(folders["pmeta"][0], "config.yaml")) as file:
        assert "<pre>%s</pre>" % html.escape(file.read()) in text
    for words in ("<dt>seeds</dt><dd>0–2</dd>", "<dt>commit</dt><dd>abc</dd>",
                  "<dt>runs</dt><dd>9</dd>", "<dt>rounds</dt><dd>4</dd>",
                  "task 0: zeta 3<br>task 1: zeta 3.5", "2026-01-01"):
        assert words in text


def test_one_run_gives_a_report_beside_its_files(tmp_path):
    folder = write_run(tmp_path)
    edit(folder, "manifest.json", lambda t: t.replace(
        '"commit"', '"versions": {"pmeta": "0.1", "a<b": "1"}, "commit"'))
    report(folder)
    path = os.path.join(folder, "report.html")
    first = Page(path).text
    assert 'href="./rounds.csv"' in first and "a&lt;b 1, pmeta 0.1" in first
    # the same runs give the same bytes
    report(folder)
    assert Page(path).text == first


@needs_chromium
def test_test_tasks_have_columns_and_a_figure(tmp_path):
    folders = [write_run(tmp_path, seed=s, contexts=(0, 2), tests=1, learner="sac", fresh=100,
                         own_best=True) for s in range(2)]
    path = tmp_path / "r.html"
    report(tmp_path, "-o", path)
    found = look(path)
    best, learning, quartiles, tasks, _ = found["tables"]
    assert quartiles[0][1] == "IQM of" and len(quartiles) == 4
    assert best[0][2:] == ["best", "last", "fresh (best)", "fresh (own best)", "fresh (last)"]
    assert best[1][5] == spread([fresh_mean(f, "own_best", "personal") for f in folders])
    last = spread([curve(f, "meta", "test", 2)[-1] for f in folders])
    assert best[3][1:4] == ["MP on test tasks", "-", last]
    assert best[3][4] == spread([fresh_mean(f, "best", "meta", split="test") for f in folders])
    assert learning[0][4] == "MP test last" and learning[1][4] == last
    assert learning[1][3] == spread([curve(f, "meta", "train", 2)[-1] for f in folders])
    assert tasks[0][4:] == ["task 0", "task 1", "test task 2"]
    by_policy = {(row[1], row[2]): row[4:] for row in tasks[1:]}
    assert by_policy["PP", "last"][2] == "-"
    assert by_policy["MP", "last"][2] == spread([fresh_mean(f, "last", "meta", split="test")
                                                 for f in folders])
    text = Page(path).text
    assert "test task 2: zeta 4" in text and "on test tasks, before and after" in text
    assert len(found["images"]) == 3 and found["overflow"] <= 0


def test_what_is_left_out_is_named_on_the_page(tmp_path):
    write_run(tmp_path)
    stopped = write_run(tmp_path, seed=1, status="stopped")
    _, err = report(tmp_path)
    note = "%s is left out: its status is 'stopped' (4 of 4 rounds), not 'finished'." % stopped
    assert err == "report: warning: %s\n" % note
    assert "Note: " + html.escape(note) in Page(tmp_path / "report.html").text


def test_several_experiments_have_a_section_each(tmp_path):
    write_run(tmp_path)
    write_run(tmp_path, experiment="other")
    report(tmp_path, "-o", tmp_path / "r.html")
    page = Page(tmp_path / "r.html")
    assert page.tags.count("img") == 2 and page.tags.count("h2") == 3
    assert "<title>pMeta: grid, other</title>" in page.text


def test_bad_input_is_told_in_one_sentence(tmp_path):
    assert refuses(tmp_path) == ("report: there are no runs in %s: a run folder holds "
                                 "manifest.json and rounds.csv." % tmp_path)
    assert "there is no folder" in refuses(tmp_path / "none")
    assert "the following arguments are required: RUN_DIR" in refuses()
    folder = write_run(tmp_path)
    (tmp_path / "file").write_text("")
    assert refuses(folder, "-o", tmp_path / "file" / "r.html").startswith("report: cannot use ")
    path = edit(folder, "rounds.csv", lambda t: t[:-3])
    assert refuses(tmp_path) == "report: %s line 17 is truncated: it does not end." % path
    assert not os.path.exists(os.path.join(folder, "report.html"))


if __name__ == "__main__":
    sys.exit(pytest.main([__file__]))
