"""Tests of the figures of `pmeta convergence`."""

import os

import pytest

from run_folders import Kept, edit, fails, plot
import pmeta_convergence as pc
import pmeta_runs as pr


@pytest.fixture
def convergence(tmp_path):
    """Results that follow the theory exactly."""
    folder = tmp_path / "convergence" / "run"
    folder.mkdir(parents=True)
    lambdas = (1, 5, 10)
    files = {
        "manifest.json": '{"status": "finished", "seed": 0}',
        "statements.csv": "statement,setting,measured,bound,holds,remark\n",
        "contraction.csv": "lambda,pairs,worst_pair,worst_shift,bound\n" + "".join(
            "%g,9,%r,%r,%r\n" % (v, 0.9 / (1 + v), 0.9 / (1 + v), 0.9 / (1 + v))
            for v in (0,) + lambdas),
        "fixed_point.csv": "lambda,update,sweeps,distance\n" + "".join(
            "%g,%s,%d,%r\n" % (v, update, k, 0.0 if update == "exact" and k > 10 else 3.0 / k)
            for v in lambdas for update in ("exact", "robbins_monro") for k in (1, 10, 100)),
        "gradient.csv": "diversity,lambda,step,eta,round,grad_norm2,running_mean,shape,distance2\n"
        + "".join("%s,%g,%s,0.1,%d,%r,%r,%r,1\n" % (tasks, v, step, c, v / c, v / c, c ** -0.5)
                  for tasks in ("corner", "centre", "random") for v in lambdas
                  for step in ("used", "allowed") for c in range(1, 21)),
        "distance.csv": "diversity,lambda,distance2,entry_distance2,entry_bound\n" + "".join(
            "%s,%g,%r,%r,%s\n" % (tasks, v, 9.0 / v ** 2, 1.0 / v ** 2, "nan" if v < 3 else "7")
            for tasks in ("corner", "centre") for v in lambdas),
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def test_convergence_figures(tmp_path, convergence):
    plot(tmp_path, "--what", "convergence", "--format", "png", "--out", tmp_path / "out")
    assert sorted(os.listdir(str(tmp_path / "out"))) == [
        "convergence_%s.png" % name
        for name in ("contraction", "distance", "fixed_point", "gradient")]


def test_convergence_slopes_are_measured(tmp_path, convergence):
    kept = Kept()
    pc.draw_convergence(pr.load_convergence([str(convergence)]), kept)
    contraction, _, gradient, distance = [figure for figure, _ in kept.written]
    line = contraction.axes[0].lines[0]
    assert list(line.get_ydata() * line.get_xdata()) == pytest.approx([0.9] * 50)
    labels = [text.get_text() for text in gradient.axes[0].get_legend().get_texts()]
    assert labels[0] == "λ=1, η=0.1: slope −1.00" and labels[-1] == "theory, scaled: slope −0.50"
    labels = [text.get_text() for text in distance.axes[1].get_legend().get_texts()]
    assert labels[:2] == ["corner: slope −2.00", "centre: slope −2.00"]


def test_broken_convergence_files_are_refused(tmp_path, convergence):
    path = edit(str(convergence), "gradient.csv", lambda t: t.replace("running_mean", "mean", 1))
    assert path + " line 1: the column 'running_mean' is missing" in fails(tmp_path)
    edit(str(convergence), "gradient.csv", lambda t: t.replace("used,0.1", "used,high", 1))
    assert path + " line 2: eta is 'high'" in fails(tmp_path)


def test_convergence_without_a_manifest_has_not_finished(tmp_path, convergence):
    (convergence / "manifest.json").unlink()
    assert "none of the 1 runs" in fails(tmp_path)
