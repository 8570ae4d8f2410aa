"""Whose a return is, as the keys of a run's returns.

"personal" is PP. (split, episodes) is the meta-policy on training or test tasks after adaptation
from so many exploration episodes, 0 where nothing is inferred. "meta", which is MP, and
"meta_test" stand for those after the most episodes of the run.
"""

POLICIES = ("personal", "meta", "meta_test")
STAND_INS = {"meta": "train", "meta_test": "test"}


def key_of(policy, split, episodes):
    return (split, episodes) if policy == "meta" else policy


def adaptations(keys, split):
    """Numbers of exploration episodes that the meta-policy was tried after, ascending."""
    return sorted(key[1] for key in keys if not isinstance(key, str) and key[0] == split)


def with_stand_ins(by_key):
    """The same and, for the meta-policy after the most episodes, "meta" and "meta_test"."""
    found = dict(by_key)
    for name, split in STAND_INS.items():
        counts = adaptations(by_key, split)
        if counts:
            found[name] = by_key[split, counts[-1]]
    return found


def split_of(key):
    return STAND_INS.get(key, "train") if isinstance(key, str) else key[0]


def words_of(key):
    """"personal", "meta", "meta (test tasks, 2 episodes)": for warnings."""
    if isinstance(key, str):
        return key
    parts = ["test tasks"] * (key[0] == "test") + ["%d episodes" % key[1]] * (key[1] > 0)
    return "meta (%s)" % ", ".join(parts) if parts else "meta"
