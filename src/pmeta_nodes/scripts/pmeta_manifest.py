"""What manifest.json says of a run: the settings that define it, and what figures must know.

pmeta_core/storage/manifest.h has the meaning of each entry. Runs from before these entries are told
by config.yaml and by older_runs.yaml.
"""

import functools
import math
import os
from types import SimpleNamespace

from pmeta_files import PlotError, parse_yaml, read_yaml, shown
from pmeta_returns import key_of

FIGURES = {"label": str, "order": int, "baseline": bool, "reference_line": bool,
           "compared_by": str, "own_settings": list, "fixed_settings": list, "policies": str,
           "curves": list}


def data_file(name):
    """What a YAML file beside the scripts holds."""
    return read_yaml(os.path.join(os.path.dirname(os.path.abspath(__file__)), name))


@functools.lru_cache(maxsize=None)
def older_runs():
    return data_file("older_runs.yaml")


def settings_of(folder, manifest):
    """{full key: value} of what defines the run."""
    texts = manifest.get("defining_settings")
    if texts is None:
        settings = flatten(read_yaml(os.path.join(folder, "config.yaml")))
        return {k: v for k, v in settings.items() if k not in older_runs()["not_defining"]}
    path = os.path.join(folder, "manifest.json")
    if not isinstance(texts, dict) or not all(isinstance(v, str) for v in texts.values()):
        raise PlotError("%s: defining_settings must hold a text for each setting." % path)
    return {key: plain(parse_yaml(text, "%s: the setting %s" % (path, shown(key))))
            for key, text in texts.items()}


def figures_of(folder, manifest, algorithm, learner):
    """The entries of FIGURES as attributes; of an unknown algorithm, those of a baseline."""
    found = manifest.get("figures")
    if found is None:
        older = older_runs()
        found = dict(older["algorithms"].get(algorithm) or unknown(algorithm),
                     policies=older["policies"].get(learner, "table"), curves=[])
    path = os.path.join(folder, "manifest.json")
    for name, kind in FIGURES.items():
        value = found.get(name) if isinstance(found, dict) else None
        if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            raise PlotError("%s: %s of its figures is missing or of the wrong type." % (path, name))
    made = SimpleNamespace(**{name: found[name] for name in FIGURES})
    made.label = shown(made.label)
    if made.compared_by not in ("personal", "meta"):
        raise PlotError("%s: compared_by is '%s' but must be personal or meta."
                        % (path, shown(made.compared_by)))
    made.fixed_settings = set(map(str, made.fixed_settings))
    made.own_settings = set(map(str, made.own_settings))
    made.curves = [key_of(*(curve.get(k) for k in ("policy", "split", "context_episodes")))
                   for curve in made.curves if isinstance(curve, dict)]
    return made


def unknown(algorithm):
    """What may be said of an algorithm that nothing is known of."""
    return {"label": algorithm.replace("_", " "), "order": 1000, "baseline": True,
            "reference_line": False, "compared_by": "personal", "own_settings": [],
            "fixed_settings": []}


def flatten(config, prefix=""):
    flat = {}
    for key, value in config.items():
        if isinstance(value, dict):
            flat.update(flatten(value, prefix + str(key) + "."))
        else:
            flat[prefix + str(key)] = plain(value)
    return flat


def plain(value):
    """A value that can be compared and hashed; YAML 1.1 takes 1e-05 for text, which it is not."""
    if isinstance(value, list):
        return plain(value[0]) if len(value) == 1 else tuple(plain(item) for item in value)
    if isinstance(value, dict):
        return tuple(sorted(flatten(value).items()))
    if isinstance(value, str):
        try:
            return float(value) if math.isfinite(float(value)) else value
        except ValueError:
            return value
    return value
