"""Tables of what few seeds allow to say: interquartile means, and who is better, with intervals."""

import pmeta_groups as pg
import pmeta_statistics as ps

POLICIES = {"pp": "personal", "mp": "meta", "mp_test": "meta_test", "all": "all"}
POLICY_WORDS = {"pp": "PP", "mp": "MP", "mp_test": "MP on test tasks", "all": "all"}
MEASURES = {"best": "best", "last": "last", "auc": "AUC", "fresh_best": "fresh (best)",
            "fresh_own_best": "fresh (own best)", "fresh_last": "fresh (last)"}
# the first that both sides have, of episodes that had no part in a choice before others
JUDGED_BY = ("fresh_best", "last")
IQM_COLUMNS = tuple("%s_%s_iqm%s" % (name, measure, what) for name in ("pp", "mp", "mp_test", "all")
                    for measure in MEASURES for what in ("", "_low", "_high")
                    if measure.startswith("fresh") or name != "all")
LEGEND = [
    "IQM: interquartile mean over seeds and tasks, which leaves out the lowest and the highest",
    "quarter; P(improvement): probability that a run of the one has a higher return on a task than",
    "one of the other, 0.5 if neither is better. [a, b]: 95 % interval of a bootstrap over seeds,",
    "stratified by task (Agarwal et al. 2021)."]


def iqm_columns(group):
    """Of IQM_COLUMNS those that are known."""
    row = {}
    for name, policy in POLICIES.items():
        for measure in MEASURES:
            key = "%s_%s_iqm" % (name, measure)
            scores = group.scores(policy, measure) if key in IQM_COLUMNS else None
            if scores is not None:
                row[key] = float(ps.interquartile_mean(scores))
                row[key + "_low"], row[key + "_high"] = ps.interval(scores) or (None, None)
    return row


def with_interval(value, limits, decimals=2):
    if value is None:
        return "-"
    text = "%.*f" % (decimals, value)
    if limits is None or None in limits:
        return text
    return text + " [%.*f, %.*f]" % (decimals, limits[0], decimals, limits[1])


def iqm_cells(rows, measures=("best", "last", "fresh_best", "fresh_own_best")):
    """(heads, lines): a line for each group and policy, a column for each measure there is."""
    names = ("pp", "mp", "mp_test", "all")
    measures = [m for m in measures if any(
        row.get("%s_%s_iqm" % (name, m)) is not None for row in rows for name in names)]
    lines = []
    for row in rows:
        label = row["group"]
        for name in names:
            keys = ["%s_%s_iqm" % (name, m) for m in measures]
            if any(row.get(key) is not None for key in keys):
                lines.append((label, POLICY_WORDS[name], str(row["seeds"])) + tuple(
                    with_interval(row.get(key), (row.get(key + "_low"), row.get(key + "_high")))
                    for key in keys))
                label = ""
    return ("group", "IQM of", "seeds") + tuple(MEASURES[m] for m in measures), lines


def compare(ours, theirs, our_name, their_name, measures=JUDGED_BY):
    """(measure, probability, interval or None) by the first measure that both have, or None."""
    for measure in measures:
        one = ours.scores(POLICIES[our_name], measure)
        other = theirs.scores(POLICIES[their_name], measure)
        if one is not None and other is not None and one.shape[1] == other.shape[1]:
            return (measure,) + ps.improvement(one, other)
    return None


def comparison_cells(groups):
    """(heads, lines): each group against each baseline with the same settings."""
    lines = []
    for group in pg.without_baselines(groups):
        for algorithm in pg.baselines(groups):
            rival = pg.baseline_of(group, groups, algorithm)
            name = "mp" if rival and rival.figures.compared_by == "meta" else "pp"
            found = compare(group, rival, name, name) if rival else None
            if found:
                measure, value, limits = found
                lines.append(("%s of %s" % (POLICY_WORDS[name], group.label),
                              "%s of %s" % (POLICY_WORDS[name], rival.label), MEASURES[measure],
                              "%d, %d" % (len(group.runs), len(rival.runs)),
                              with_interval(value, limits)))
    return ("who", "against", "returns", "seeds", "P(improvement)"), lines
