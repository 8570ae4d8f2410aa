"""docs/results/plan.yaml: the sweeps whose results the pages show, and what they are judged by."""

import os
import re
import shlex

from pmeta_comparisons import MEASURES, POLICIES
from pmeta_files import PlotError, read_yaml, shown

SWEEP = {"name": str, "experiment": str, "assignments": str, "use": str, "priority": int,
         "core_hours": float, "page": str}
AIM = {"aim": str, "runs": dict, "policy": str, "measure": str, "number": float, "source": str}
CLAIM = {"claim": str, "ours": dict, "theirs": dict, "measure": str}
FIGURES = {"folder": str, "sweeps": list, "kinds": list, "keep": list}
# settings were chosen on the seeds for selection; what is claimed rests on those for test
USES = ("test", "selection")


class Plan:
    def __init__(self, path):
        self.path = path
        data = read_yaml(path)
        unknown = sorted(set(data) - {"sweeps", "aims", "claims", "figures"})
        if unknown:
            raise PlotError("%s: unknown key '%s'." % (path, shown(str(unknown[0]))))
        self.sweeps = {sweep["name"]: sweep for sweep in self._entries(data, "sweeps", SWEEP)}
        self.aims = self._entries(data, "aims", AIM)
        self.claims = self._entries(data, "claims", CLAIM)
        self.figures = {f["folder"]: f for f in self._entries(data, "figures", FIGURES)}
        self._check()

    def in_order(self):
        """By priority, 1 first; of equal ones in the order of the file."""
        return sorted(self.sweeps.values(), key=lambda sweep: sweep["priority"])

    def sweep(self, name):
        if name not in self.sweeps:
            raise PlotError("%s has no sweep '%s'; it has: %s."
                            % (self.path, shown(name), ", ".join(self.sweeps)))
        return self.sweeps[name]

    def _entries(self, data, key, kinds):
        entries = data.get(key) or []
        if not isinstance(entries, list):
            raise PlotError("%s: %s must be a list." % (self.path, key))
        for number, entry in enumerate(entries, start=1):
            where = "%s: %s, entry %d" % (self.path, key, number)
            if not isinstance(entry, dict) or set(entry) != set(kinds):
                raise PlotError("%s must have exactly: %s." % (where, ", ".join(kinds)))
            for name, kind in kinds.items():
                if isinstance(entry[name], int) and kind is float:
                    entry[name] = float(entry[name])
                if not isinstance(entry[name], kind) or isinstance(entry[name], bool):
                    raise PlotError("%s: %s must be of type %s." % (where, name, kind.__name__))
        return entries

    def _check(self):
        for sweep in self.sweeps.values():
            if not re.fullmatch(r"\w+", sweep["name"]) or sweep["use"] not in USES:
                raise PlotError("%s: sweep '%s' needs a name of letters, digits and _, and a use, "
                                "%s." % (self.path, shown(sweep["name"]), " or ".join(USES)))
            if not seeds_of(sweep):
                raise PlotError("%s: the assignments of sweep '%s' have no seed:=…."
                                % (self.path, sweep["name"]))
        sides = self.aims + [claim[side] for claim in self.claims for side in ("ours", "theirs")]
        for side in sides:
            # where it is to be looked for
            for name in runs_of(side)[0]:
                if self.sweep(name)["use"] == "selection":
                    raise PlotError("%s: sweep '%s' has selection seeds, on which settings were "
                                    "chosen: nothing is judged by them." % (self.path, name))
            if side.get("policy") not in POLICIES:
                raise PlotError("%s: policy is '%s' but must be one of %s." % (
                    self.path, shown(str(side.get("policy"))), ", ".join(POLICIES)))
        for judged in self.aims + self.claims:
            if judged["measure"] not in MEASURES:
                raise PlotError("%s: measure is '%s' but must be one of %s." % (
                    self.path, shown(judged["measure"]), ", ".join(MEASURES)))


def runs_of(side):
    """([names of sweeps], {setting: value}) of the runs that an aim or a side of a claim is of."""
    settings = dict(side.get("runs") or {})
    names = settings.pop("sweep", "")
    return str(names).split(), settings


def command_of(sweep):
    """The words of a sweep after `./pmeta sweep`."""
    return [sweep["experiment"]] + shlex.split(sweep["assignments"]) + ["--name", sweep["name"]]


def seeds_of(sweep):
    """"100-104", as its assignments have it."""
    found = [w[len("seed:="):] for w in shlex.split(sweep["assignments"]) if w.startswith("seed:=")]
    return found[0] if len(found) == 1 else ""


def command_text(words):
    return "./pmeta sweep " + " ".join(
        w if re.fullmatch(r"[\w:=,.\[\]-]+", w) else shlex.quote(w) for w in words)


def plan_in(folder):
    return Plan(os.path.join(folder, "plan.yaml"))
