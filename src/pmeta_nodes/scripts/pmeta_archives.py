"""Finished sweeps as small files: run folders without policies and checkpoints, as .tar.xz.

`tar -xf` gives folders that ./pmeta plot and ./pmeta report read. sweep.json beside them holds the
command. The same sweep gives the same bytes: names are sorted, and nothing says when or where it
was packed.
"""

import contextlib
import io
import json
import os
import re
import tarfile
import tempfile

from pmeta_files import PlotError, read_json, read_text

FILES = ("config.yaml", "final.csv", "manifest.json", "rounds.csv", "trajectories.csv")
COMMAND = "sweep.json"
# where a run was written is of no use elsewhere
PLACE = re.compile(r"^results_dir: .*$", re.M)


def archive_of(folder, name):
    return os.path.join(folder, "data", name + ".tar.xz")


def pack(path, name, words, run_folders):
    """Writes the archive of a sweep whose runs have all finished."""
    texts = {COMMAND: json.dumps({"name": name, "command": words}, indent=1) + "\n"}
    for run in run_folders:
        for file in FILES:
            source = os.path.join(run, file)
            if os.path.isfile(source):
                text = read_text(source)
                texts["%s/%s" % (os.path.basename(run), file)] = (
                    PLACE.sub("results_dir: results", text) if file == "config.yaml" else text)
    os.makedirs(os.path.dirname(path), exist_ok=True)
    # never half an archive
    with tarfile.open(path + ".new", "w:xz", format=tarfile.USTAR_FORMAT) as archive:
        for member in sorted(texts):
            data = texts[member].encode("utf-8")
            info = tarfile.TarInfo(name + "/" + member)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    os.replace(path + ".new", path)


@contextlib.contextmanager
def unpacked(paths):
    """A folder with the runs of all the archives, for as long as the context lasts."""
    with tempfile.TemporaryDirectory(prefix="pmeta_results_") as top:
        for path in paths:
            with _opened(path) as archive:
                for member in archive:
                    parts = member.name.split("/")
                    if not member.isfile() or len(parts) > 3 or not all(
                            re.fullmatch(r"[\w.+-]*\w", part) for part in parts):
                        raise PlotError("%s holds '%s', which is no file of a run."
                                        % (path, member.name))
                    target = os.path.join(top, *parts)
                    os.makedirs(os.path.dirname(target), exist_ok=True)
                    with open(target, "wb") as file:
                        file.write(archive.extractfile(member).read())
        yield top


def packed_command(path):
    """The words of the sweep whose archive it is."""
    name = os.path.basename(path)[:-len(".tar.xz")]
    with unpacked([path]) as top:
        words = read_json(os.path.join(top, name, COMMAND)).get("command")
    if not isinstance(words, list):
        raise PlotError("%s: its %s has no command." % (path, COMMAND))
    return [str(word) for word in words]


def _opened(path):
    try:
        return tarfile.open(path, "r:xz")
    except (tarfile.TarError, EOFError) as error:
        raise PlotError("%s is no archive of a sweep (%s)." % (path, error))
